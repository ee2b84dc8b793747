// What a population's rounding costs: a run's own weights and the same person's member of the
// population, both in float arithmetic, against the truth of the held-out views and poses.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "toolchain/train/trained_avatar.h"

namespace figurine::reconstruction {

struct RequantizationOptions {
  uint32_t view_frame_step = 8;  // every n-th training pose is looked at from the held-out cameras
  bool quiet = false;
};

// {"views", "poses"}, each {"psnr_db", "member_psnr_db", "loss_db"}: pooled, as
// evaluate_reconstruction has them. The run's model keeps its own weights. Throws InputError if the
// member's network is of another shape.
nlohmann::json evaluate_requantization(train::TrainedAvatar& avatar, const Avatar& member,
                                       const RequantizationOptions& options);

}  // namespace figurine::reconstruction
