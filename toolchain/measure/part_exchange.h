// Where one part of a person ends and the next begins on a population's maps, and how two people's
// values are blended there: what a head, a jacket or trousers taken from somebody else is made of.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "toolchain/measure/body_parts.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::measure {

// What may come from somebody else: the first of BodyPart. Hands stay with whose body it is.
inline constexpr std::array kExchangedParts{BodyPart::kHead, BodyPart::kUpperBody,
                                            BodyPart::kLowerBody};

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
  const std::vector<double>& share(BodyPart part, size_t group) const {
    return shares_[static_cast<size_t>(part)][group];
  }
  // [D] of every value of a member's vector: its cell's; 0 of network and shape. layout: the
  // population's on this body.
  RowVector value_shares(BodyPart part, const WeightLayout& layout) const;
  size_t texels(BodyPart part) const { return texels_[static_cast<size_t>(part)]; }

 private:
  std::array<std::vector<std::vector<double>>, kExchangedParts.size()>
      shares_;  // [parts][groups][cells]
  std::array<size_t, kExchangedParts.size()> texels_{};
  std::vector<uint32_t> channels_;  // [groups]
};

}  // namespace figurine::measure
