// What lies between and around the training members: how well their principal directions reach
// members that they never saw, and what a mixture of two members looks like.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "toolchain/members/member_set.h"

namespace figurine::members {

// The spectrum of the training part: {"whole": {...}, "tokens": [{...}]}, each with "entries" (that
// vary), "shared" (that do not), "directions", "directions_for" {"50", "90", "99"},
// "participation_ratio" and "variance_share" (of every direction, descending). bases: one for each
// token, and the whole's last.
nlohmann::json describe_spectrum(const MemberSet& set,
                                 const std::vector<measure::PrincipalBasis>& bases);
std::vector<measure::PrincipalBasis> make_bases(const MemberSet& set);

// Held-out members projected onto the first r directions of every token ("per_layer") and of
// everything at once ("whole"), and drawn beside themselves (docs/numerics.md, "Weight space").
// null without held-out members. Ranks beyond N - 1 are left out, N - 1 is always there.
nlohmann::json measure_span(const MemberSet& set, const std::vector<measure::PrincipalBasis>& bases,
                            std::vector<uint32_t> ranks);

// Two training members to mix, and why these.
struct MixedPair {
  size_t a = 0, b = 0;
  std::string why;
};

// {"steps": [0, ...], "pairs": [...]}: for every step the high-pass energy and the foreground area
// over the mean of the two ends', and the nearest training member in weights and in pictures.
nlohmann::json measure_interpolation(const MemberSet& set, const std::vector<MixedPair>& pairs);

// The shares of the second member that are measured and shown.
inline constexpr double kMixSteps[] = {0, 0.25, 0.5, 0.75, 1};

// weights, shape, map statistics and decoding of (1 - share) a + share b; a and b must be of one
// population, whose layout this is. Borrows from the storage.
Avatar mix(const measure::WeightLayout& layout, const Avatar& a, const Avatar& b, double share,
           measure::WeightStorage& storage);

}  // namespace figurine::members
