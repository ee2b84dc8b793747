// How a generator's people compare with people that it has seen and with people that it has not
// (docs/numerics.md, "Generation"): MMD, COV and 1-NNA of pictures, the novelty audit in weights
// and in pictures, and sharpness, for trained samplers and for the rows that they have to beat; the
// same in the distance and the features of networks where there are any. Pictures are the device
// renderer's in a population's common poses and views; references are renders of trained avatars
// and, on request, captures of the held-out people themselves.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/features/feature_network.h"
#include "toolchain/generation/people_distances.h"
#include "toolchain/members/member_set.h"

namespace figurine::generation {

// People to be judged. A sampler's, or a baseline's.
struct Generated {
  std::string name;
  measure::RowMatrix z;  // [S,D] standardised weights, S >= N of the training part
  size_t learnt = 0;  // from the first so many training members, whom the audit looks for; 0: all
};

// The rows that need no training: a Gaussian in every token's `rank` principal directions, averages
// of 2 to 5 members, the perfect memoriser, and training members with noise whose pictures are as
// far from their member as `noised_db` says. [N,D] each.
std::vector<Generated> make_baselines(const members::MemberSet& set, size_t rank, double noised_db,
                                      uint64_t seed);

struct GenerationOptions {
  size_t replicates = 1000;  // of the bootstrap
  uint64_t seed = 0;
  features::ComparingNetworks networks;  // by which pictures are compared besides PSNR
  uint32_t threads = 1;                  // of the networks
  People captures;  // of the held-out members (captured_people.h), in the set's order, as further
                    // references; or empty
  People unseen;    // captures of people who are in no part of the population; or empty
};

// "references": what the sets are; "rows": one for each of the generated, and one of the held-out
// members themselves for the audit and sharpness. Throws InputError if there are fewer than two
// held-out members or more than training ones, or if a network cannot take the pictures; or
// Interrupted.
nlohmann::json evaluate_generation(const members::MemberSet& set,
                                   const std::vector<Generated>& generated,
                                   const GenerationOptions& options);

// Median PSNR of rows' pictures to the nearest training member's: what `noised_db` is matched to.
double nearest_member_db(const members::MemberSet& set, const Generated& generated,
                         size_t most = 50);

}  // namespace figurine::generation
