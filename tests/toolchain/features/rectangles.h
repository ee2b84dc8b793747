// Pictures to compare.
#pragma once

#include <cmath>

#include "runtime/test_packages.h"
#include "toolchain/features/feature_network.h"

namespace figurine::features::test {

// Rectangles of random colours on grey: edges and flat parts, as people are.
inline RgbPictures rectangles(uint32_t width_px, uint32_t height_px, size_t count, uint64_t seed) {
  tests::Random random(seed);
  RgbPictures pictures{width_px, height_px,
                       std::vector<float>(count * 3 * width_px * height_px, 0.5f)};
  for (size_t n = 0; n < count; ++n) {
    for (int r = 0; r < 25; ++r) {
      const float x = random.uniform(0.1f, 0.9f), y = random.uniform(0.1f, 0.9f),
                  half = random.uniform(0.02f, 0.2f);
      const float colour[3] = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
      for (uint32_t j = 0; j < height_px; ++j) {
        for (uint32_t i = 0; i < width_px; ++i) {
          const float u = (static_cast<float>(i) + 0.5f) / static_cast<float>(width_px) - x,
                      v = (static_cast<float>(j) + 0.5f) / static_cast<float>(height_px) - y;
          if (std::abs(u) > half || std::abs(v) > half) continue;
          for (size_t c = 0; c < 3; ++c)
            pictures.values[((n * 3 + c) * height_px + j) * width_px + i] = colour[c];
        }
      }
    }
  }
  return pictures;
}

}  // namespace figurine::features::test
