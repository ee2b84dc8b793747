// What a population is like, from its package alone: quality, distances between members, the
// spectrum of their weights, how well the training members span the held-out ones, what lies
// between two of them, and what the parts of two are together. docs/json.md describes the report,
// docs/numerics.md the quantities.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "toolchain/members/member_set.h"
#include "toolchain/members/member_span.h"
#include "toolchain/members/mixtures.h"
#include "toolchain/members/part_mixtures.h"

namespace figurine::members {

// "all", "train", "validation" and "test" (null where a part is empty), each name's {"mean",
// "worst", "best", "standard_deviation", "count"}; and "worst_members" by PSNR on held-out poses.
// Greater is better for every quality that packages carry.
nlohmann::json describe_quality(const Population& population, size_t worst);
// Members by PSNR on held-out poses, the worst first; those without come not at all.
std::vector<size_t> worst_members(const Population& population, size_t count);

// How far members are from each other, in weights and in pictures.
struct MemberDistances {
  explicit MemberDistances(const MemberSet& set);
  std::vector<size_t> members;  // training ones, then held-out ones: the order of the rows
  size_t training = 0;          // N
  measure::RowMatrix weights;   // [M,N] root mean square over standardised weights
  measure::RowMatrix mse;       // [M,N] of the pictures, over both foregrounds
};
nlohmann::json describe_distances(const MemberSet& set, const MemberDistances& distances);

// Training pairs worth mixing: farthest apart in weights, farthest in pictures, and one of middling
// distance; no pair twice, no member twice as long as there are enough.
std::vector<MixedPair> choose_pairs(const MemberDistances& distances);

struct MembersOptions {
  std::vector<uint32_t> ranks{1, 2, 4, 8, 16, 32, 64, 128, 256, 512};
};
// The whole report but for where it came from. "span_db" repeats span.per_layer by rank:
// {"8": 21.5, ...}; null without held-out members. parts: null where members cannot be mixed by
// part; then "part_mixtures" is null.
nlohmann::json evaluate_members(const MemberSet& set, const MemberDistances& distances,
                                const std::vector<MixedPair>& pairs,
                                const measure::PartExchange* parts, const MembersOptions& options);

}  // namespace figurine::members
