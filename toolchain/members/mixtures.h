// What a mixture of two members is like: is there a person between two people, or a blur of both?
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/members/member_set.h"

namespace figurine::members {

// Two training members to mix, and why these.
struct MixedPair {
  size_t a = 0, b = 0;
  std::string why;
};

// The shares of the second member that are measured and shown.
inline constexpr double kMixSteps[] = {0, 0.25, 0.5, 0.75, 1};

// weights, shape, map statistics and decoding of (1 - share) a + share b; a and b must be of one
// population, whose layout this is. Borrows from the storage.
Avatar mix(const measure::WeightLayout& layout, const Avatar& a, const Avatar& b, double share,
           measure::WeightStorage& storage);

// What is told of somebody mixed of two.
struct Mixture {
  double energy = 0, foreground = 0;  // high-pass energy and foreground pixels of the pictures
  // {"highpass_ratio", "foreground_ratio", "nearest"}: over the mean of the two ends', and the
  // nearest training member in weights and in pictures.
  nlohmann::json describe(const Mixture& a, const Mixture& b) const;
  std::string weights_member, picture_member;
  double weights_rms = 0, picture_db = 0;
};
Mixture measure_mixture(const MemberSet& set, const Avatar& mixed);

// {"steps": [0, ...], "pairs": [...]}: a mixture's description for every step.
nlohmann::json measure_interpolation(const MemberSet& set, const std::vector<MixedPair>& pairs);

}  // namespace figurine::members
