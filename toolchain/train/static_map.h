// The static values of an avatar in training (StaticPart in figurine/avatar.h): floats that the
// optimiser moves, and the 8-bit values that a package holds of them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "figurine/avatar.h"
#include "toolchain/model/compose.h"
#include "toolchain/tensor.h"

namespace figurine::train {

struct StaticMap {
  std::vector<std::array<int64_t, 2>> shapes;  // [groups] cells, channels
  torch::Tensor values;                        // [P] float, group by group, each [M,channels]

  StaticMap() = default;
  explicit StaticMap(const model::HeadComposer& composer);  // zeros: the network's head alone
  bool empty() const { return shapes.empty(); }
};

// The values in 8 bits. A channel of a group has one scale: the largest magnitude over 127, or the
// share of it, from a half up, whose squared error over the values, clipping included, is smallest.
class RoundedMap {
 public:
  // Throws InputError for colours as a sum, which packages do not hold.
  RoundedMap(const StaticMap& map, const model::HeadLayout& layout);

  StaticPart view() const;  // borrows from this object
  size_t value_count() const { return values_.size(); }
  size_t size_bytes() const { return values_.size() + scale_.size() * sizeof(float); }

 private:
  std::vector<StaticGroup> groups_;           // without their spans
  std::vector<std::array<size_t, 2>> begin_;  // [groups] in values_, in scale_
  std::vector<int8_t> values_;
  std::vector<float> scale_;
};

// The map becomes what a package holds. Throws InputError "static part: reason" if it is not one of
// this layout.
void take_static_part(const StaticPart& part, const model::HeadLayout& layout, StaticMap& map);

}  // namespace figurine::train
