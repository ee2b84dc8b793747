// The statistical body of MakeHuman's macro targets: mean template and principal components over a
// seeded sample of plausible adults.
//
// Joints are means of listed vertices, so the same linear map carries mean and components from
// vertices to joints. Based on: principal components by the Gram matrix of the samples (Turk,
// Pentland, Eigenfaces for Recognition, 1991, section 2.1).
#pragma once

#include <cstdint>

#include "toolchain/body/body_model.h"
#include "toolchain/body/makehuman.h"

namespace figurine::body {

// A plausible adult for every seed: women and men, 25 to 75 years, average to strong, thin to
// heavy, any mixture of ancestries, and heights with a standard deviation of 7 cm. The same seed
// gives the same person on every machine.
MacroShape sample_macro_shape(uint64_t seed);

struct ShapeBasisOptions {
  uint32_t coefficients = 20;  // S
  uint32_t samples = 400;
  uint64_t seed = 1;  // sample i is sample_macro_shape(mixed from seed and i); use seeds below 2^32
};

// Mean and components over the body's 13,380 vertices; unit of a coefficient: one standard
// deviation.
BodyModel make_makehuman_model(const MakeHuman& makehuman, const ShapeBasisOptions& options = {});

}  // namespace figurine::body
