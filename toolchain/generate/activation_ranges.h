// The scales of a sampled avatar's values in fixed point. A sampled network has no poses to be
// calibrated on where it is sampled, so all of a sampler's avatars share the ranges that its
// training members' values take, found before the sampler is packed.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/package.h"
#include "toolchain/quantize/calibration.h"

namespace figurine::generate {

struct ActivationRanges {
  std::vector<Quantisation> values;  // [layers] as FixedPointNetwork has them
  uint32_t members = 0, poses = 0;   // training members, and poses of each
};

// Runs every training member in float in `poses` poses: golden poses of training members, as
// different from each other as they can be. The ranges are chosen from all of their values
// together. Throws InputError if the body is another, or if no training member has a golden pose.
ActivationRanges observe_training_members(const Population& population, const Package& body,
                                          uint32_t poses,
                                          const quantize::CalibrationOptions& options,
                                          bool quiet = false);

}  // namespace figurine::generate
