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

// A report (docs/evaluation.md): the groups "held_out_views", "held_out_poses" (with "interleaved"
// and "block" apart) and "held_out_views_and_poses", each with psnr_db, flat_psnr_db, crop_psnr_db,
// head_psnr_db, highpass_ratio, head_highpass_ratio, mask_iou, uncovered_share, images;
// difference_psnr_db of the block, and the sizes of the avatar's parts.
nlohmann::json evaluate_reconstruction(train::TrainedAvatar& avatar,
                                       const ReconstructionOptions& options);

}  // namespace figurine::reconstruction
