// How well a trained avatar shows its person where it was not trained: held-out cameras, held-out
// poses, both. Metrics are those of metrics.h.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "toolchain/train/trained_avatar.h"

namespace figurine::reconstruction {

struct ReconstructionOptions {
  bool quiet = false;
  // Only every n-th frame of the training poses is looked at in "held-out views" (all held-out
  // frames always are). 1: all.
  uint32_t view_frame_step = 1;
};

// A report (docs/json.md, "evaluate reconstruction"): the groups "held_out_views",
// "held_out_poses" (with "interleaved" and "block" apart) and "held_out_views_and_poses", each with
// the figures of Group over the cameras of whole bodies, and the same with "bust_" before their
// names over those of head and shoulders, where there are any; difference_psnr_db of the block, and
// the sizes of the avatar's parts.
nlohmann::json evaluate_reconstruction(train::TrainedAvatar& avatar,
                                       const ReconstructionOptions& options);

}  // namespace figurine::reconstruction
