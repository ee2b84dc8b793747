#include "toolchain/measure/resized.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "figurine/check.h"

namespace figurine::measure {

namespace {

// Which old pixels a new one is made of along a side.
struct Part {
  uint32_t from;
  float weight;
};
using Parts = std::vector<Part>;

Parts bilinear(uint32_t pixel, double ratio, uint32_t last) {
  const double at = (pixel + 0.5) * ratio - 0.5, below = std::floor(at), fraction = at - below;
  const auto clamped = [&](double index) {
    return static_cast<uint32_t>(std::clamp(index, 0.0, static_cast<double>(last)));
  };
  return {{clamped(below), static_cast<float>(1 - fraction)},
          {clamped(below + 1), static_cast<float>(fraction)}};
}

Parts covered(uint32_t pixel, double ratio, uint32_t last) {
  Parts parts;
  const double begin = pixel * ratio, end = (pixel + 1) * ratio;
  for (uint32_t from = static_cast<uint32_t>(begin); from <= last && from < end; ++from) {
    const double share = std::min(end, from + 1.0) - std::max(begin, double(from));
    parts.push_back({from, static_cast<float>(share / ratio)});
  }
  return parts;
}

std::vector<Parts> parts_of(uint32_t from_px, uint32_t to_px) {
  std::vector<Parts> parts;
  const double ratio = double(from_px) / to_px;
  for (uint32_t pixel = 0; pixel < to_px; ++pixel)
    parts.push_back(to_px < from_px ? covered(pixel, ratio, from_px - 1)
                                    : bilinear(pixel, ratio, from_px - 1));
  return parts;
}

}  // namespace

Picture resized(const Picture& picture, uint32_t width_px, uint32_t height_px) {
  FIG_CHECK(width_px > 0 && height_px > 0 && picture.width_px > 0 && picture.height_px > 0,
            "pictures with pixels");
  const std::vector<Parts> columns = parts_of(picture.width_px, width_px),
                           rows = parts_of(picture.height_px, height_px);
  std::vector<float> wide(size_t(width_px) * picture.height_px * 4);
  for (uint32_t y = 0; y < picture.height_px; ++y) {
    for (uint32_t x = 0; x < width_px; ++x) {
      float* to = &wide[(size_t(y) * width_px + x) * 4];
      for (const Part& part : columns[x]) {
        const uint8_t* from = &picture.rgba[(size_t(y) * picture.width_px + part.from) * 4];
        for (int c = 0; c < 4; ++c) to[c] += part.weight * static_cast<float>(from[c]);
      }
    }
  }
  Picture result{width_px, height_px, std::vector<uint8_t>(size_t(width_px) * height_px * 4)};
  for (uint32_t y = 0; y < height_px; ++y) {
    for (size_t i = 0; i < size_t(width_px) * 4; ++i) {
      float sum = 0;
      for (const Part& part : rows[y])
        sum += part.weight * wide[size_t(part.from) * width_px * 4 + i];
      result.rgba[size_t(y) * width_px * 4 + i] =
          static_cast<uint8_t>(std::clamp(sum + 0.5f, 0.0f, 255.0f));
    }
  }
  return result;
}

}  // namespace figurine::measure
