// A picture scaled until it covers another size, its shape kept: what does not fit is cut off
// alike on both sides. By a triangle as wide as a pixel of the smaller picture: linear where it
// grows, a weighted mean where it shrinks.
#pragma once

#include <cstdint>
#include <vector>

#include "ports/media/image.h"

namespace figurine::ports {

// Remembers the weights of the last pair of sizes: for one picture after the other.
class CoverScaler {
 public:
  // picture: RGB, sound (FIG_CHECK). covered: of its size and three channels, every pixel written.
  void scale(const ImageU8& picture, ImageU8& covered);

 private:
  // The pixels that one of the result is made of.
  struct Taps {
    uint32_t first = 0;
    std::vector<float> weights;  // sum 1
  };
  static std::vector<Taps> taps(uint32_t from, uint32_t to, double step);

  uint32_t from_width_ = 0, from_height_ = 0, width_ = 0, height_ = 0;
  std::vector<Taps> columns_, rows_;
  std::vector<float> narrowed_;  // [from_height, width, 3]
};

}  // namespace figurine::ports
