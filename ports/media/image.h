// An image in memory, as the file formats of this folder read and write it. No arithmetic, no
// colour management: values are stored values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace figurine::ports {

// [height, width, channels], top row first, rows without padding. 1 channel: grey or mask; 3: RGB;
// 4: RGBA with straight alpha.
template <class T>
struct Image {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
  uint32_t channels = 0;
  std::vector<T> pixels;

  Image() = default;
  Image(uint32_t width, uint32_t height, uint32_t channel_count)
      : width_px(width),
        height_px(height),
        channels(channel_count),
        pixels(size_t(width) * height * channel_count) {}

  T* at(uint32_t x, uint32_t y) { return pixels.data() + (size_t(y) * width_px + x) * channels; }
  const T* at(uint32_t x, uint32_t y) const {
    return pixels.data() + (size_t(y) * width_px + x) * channels;
  }
  // Whether the sizes agree with each other and with a file format's limits: 1 to 16384 pixels a
  // side, 1, 3 or 4 channels.
  bool sound() const {
    return width_px >= 1 && width_px <= 16384 && height_px >= 1 && height_px <= 16384 &&
           (channels == 1 || channels == 3 || channels == 4) &&
           pixels.size() == size_t(width_px) * height_px * channels;
  }
};

using ImageU8 = Image<uint8_t>;
using ImageF32 = Image<float>;

}  // namespace figurine::ports
