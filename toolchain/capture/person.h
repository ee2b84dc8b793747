// A person from a seed: shape, skin, hair, clothes, as skinned meshes in the rest pose, with the
// body package's shape coefficients beside them.
#pragma once

#include <cstdint>
#include <string>

#include "figurine/body.h"
#include "toolchain/body/body_model.h"
#include "toolchain/body/makehuman.h"
#include "toolchain/capture/mesh.h"
#include "toolchain/capture/wardrobe.h"

namespace figurine::capture {

struct PersonRequest {
  uint64_t seed = 1;
  WardrobeLimits limits;  // the mannequin has no wardrobe: InputError if there are any
};

// A dressed MakeHuman person. body must be a package made from the same base mesh (any T).
// directory: the unpacked npm package. InputError if body does not belong to it, or a file of the
// wardrobe is missing or damaged.
Person make_makehuman_person(const PersonRequest& request, const body::MakeHuman& makehuman,
                             const std::string& directory, const Body& body);

// The mannequin with a painted shirt, trousers, shoes, gloves and face: needs no data.
Person make_mannequin_person(const PersonRequest& request, const Body& body);

// The shape coefficients of `body` nearest to the person's surface in the least-squares sense over
// its texels, and the mean distance left over. surface: the person's own, with the same triangles
// and UVs as the package was made from.
struct ShapeFit {
  std::vector<float> shape;  // [S]
  double error_m = 0;
};
ShapeFit fit_shape(const Body& body, const body::Surface& surface);

}  // namespace figurine::capture
