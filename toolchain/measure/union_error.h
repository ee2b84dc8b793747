// How different two people look, neither of whom is the truth: squared errors over the pixels that
// are foreground in either picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "toolchain/measure/metrics.h"

namespace figurine::measure {

// Over pixels that are foreground in either picture, over mid-grey: unlike foreground_error neither
// of the two is the truth.
SquaredError union_error(const Picture& a, const Picture& b);
SquaredError union_error(std::span<const Picture> a, std::span<const Picture> b);

// The same for many pairs of the same members: pixels that are foreground in no member are left out
// once, the rest is compared in integers.
class ComparedPictures {
 public:
  // members: [M] of as many pictures each.
  explicit ComparedPictures(std::span<const std::vector<Picture>> members);
  SquaredError error(size_t a, size_t b) const;

 private:
  size_t pixels_ = 0;                // P of all pictures of a member together
  std::vector<int16_t> values_;      // [M,3,P] in half levels: 2 c + (255 - alpha)
  std::vector<int16_t> foreground_;  // [M,P] -1 or 0
};

}  // namespace figurine::measure
