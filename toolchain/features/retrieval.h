// How well networks compare people: is the same person found again in another pose, seen from
// another side? Against chance and against plain pixels, on members that nobody learnt from and,
// beside them, on as many training members. And how far apart pictures are that were blurred or
// made noisy.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "toolchain/features/feature_network.h"

namespace figurine {
class Package;
struct Motion;
}  // namespace figurine

namespace figurine::features {

struct RetrievalOptions {
  const Motion* motion =
      nullptr;              // whose poses are drawn; without: golden poses of training members
  uint32_t first_pose = 8;  // of the fixed poses: those before are figurine-features' own
  uint32_t poses = 3, views = 3;
  uint64_t seed = 2;  // of the cameras: not the ones that figurine-features was trained with
  uint32_t threads = 1;
  bool quiet = false;
};

// By name, what every network says of itself. Throws InputError if one learnt from a member of this
// population that is held out.
nlohmann::json describe_networks(const ComparingNetworks& networks, const Package& population);

// docs/features.md describes the report. Throws InputError if the population has fewer than two
// held-out members, or if a network learnt from one of them; Interrupted.
nlohmann::json evaluate_networks(const Package& population, const Package& body,
                                 const ComparingNetworks& networks,
                                 const RetrievalOptions& options);

// The same pictures, worse: a Gaussian blur of this deviation in pixels, edges repeated; normal
// noise of this deviation, clipped to [0,1].
RgbPictures blurred(const RgbPictures& pictures, double deviation_px);
RgbPictures noisy(const RgbPictures& pictures, double deviation, uint64_t seed);

}  // namespace figurine::features
