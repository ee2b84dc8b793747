// People put together of two by part: the head of one on another, a jacket, trousers. A member's
// map says texel by texel what it looks like, so the cells of a part are taken from another
// member's map; shape, network and all else stay those of whom the part is put on.
#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/members/mixtures.h"
#include "toolchain/pictures/body_parts.h"

namespace figurine::members {

// What is told and shown of a pair: the two themselves, and a with a part of b's.
enum class PartRow : uint8_t { kA, kB, kHead, kUpperBody, kLowerBody };
inline constexpr std::array kPartRows{PartRow::kA, PartRow::kB, PartRow::kHead, PartRow::kUpperBody,
                                      PartRow::kLowerBody};

// Why members cannot be mixed by part: they have no maps, or the body has no texel that a joint
// with a part's name moves most. Empty: they can.
std::string part_mixture_obstacle(const Population& population, const Body& body);

// How much of a cell's values comes from whom a part is taken from: 1 inside of the part and 0
// outside, with a seam between: with d the canonical distance of the cell's texel to the nearest
// texel on the other side and s its spacing on the grid,
//   share = 0.5 + min(0.5, d / (2 kSeamTexels s)) inside, 0.5 - min(...) outside,
// so that no hard line shows.
class PartExchange {
 public:
  static constexpr double kSeamTexels = 2.5;

  // Of the population's grids over the body. part_mixture_obstacle must be empty.
  PartExchange(const Population& population, const Body& body);

  // [cells of the group's grid]
  const std::vector<double>& share(pictures::BodyPart part, size_t group) const {
    return shares_[static_cast<size_t>(part)][group];
  }
  size_t texels(pictures::BodyPart part) const { return texels_[static_cast<size_t>(part)]; }

 private:
  static constexpr size_t kParts = 3;  // head, upper body, lower body: the first of BodyPart
  std::array<std::vector<std::vector<double>>, kParts> shares_;  // [parts][groups][cells]
  std::array<size_t, kParts> texels_{};
};

// a, b, or a with b's part. a and b must be of the population whose layout and parts these are.
// Borrows from the storage.
Avatar part_row(const measure::WeightLayout& layout, const PartExchange& parts, const Avatar& a,
                const Avatar& b, PartRow row, measure::WeightStorage& storage);

// {"seam_texels", "texels": {"head", "upper_body", "lower_body"}, "pairs": [{"a", "b", "why",
// "rows": [...]}]}: a mixture's description for every row, which is called "of": "a", "b", "head",
// "upper_body" or "lower_body".
nlohmann::json measure_part_mixtures(const MemberSet& set, const PartExchange& parts,
                                     const std::vector<MixedPair>& pairs);

}  // namespace figurine::members
