#include "ports/v4l2/ycbcr_rows.h"

#include <algorithm>
#include <cmath>

namespace figurine::ports {

namespace {

constexpr int kBits = 16;

int fixed(double value) { return static_cast<int>(std::lround(value * (1 << kBits))); }

}  // namespace

YcbcrRows::YcbcrRows(YcbcrMatrix matrix, bool full_range) : black_(full_range ? 0 : 16) {
  const double kr = matrix == YcbcrMatrix::kBt601 ? 0.299 : 0.2126,
               kb = matrix == YcbcrMatrix::kBt601 ? 0.114 : 0.0722, kg = 1 - kr - kb;
  const double luma = full_range ? 1 : 255.0 / 219, chroma = full_range ? 1 : 255.0 / 224;
  luma_ = fixed(luma);
  red_cr_ = fixed(chroma * 2 * (1 - kr));
  blue_cb_ = fixed(chroma * 2 * (1 - kb));
  green_cr_ = fixed(-chroma * 2 * (1 - kr) * kr / kg);
  green_cb_ = fixed(-chroma * 2 * (1 - kb) * kb / kg);
}

void YcbcrRows::pixel(int luma, int cb, int cr, uint8_t* rgb) const {
  const int grey = luma_ * (luma - black_) + (1 << (kBits - 1));
  const auto code = [](int value) {
    return static_cast<uint8_t>(std::clamp(value >> kBits, 0, 255));
  };
  rgb[0] = code(grey + red_cr_ * (cr - 128));
  rgb[1] = code(grey + green_cr_ * (cr - 128) + green_cb_ * (cb - 128));
  rgb[2] = code(grey + blue_cb_ * (cb - 128));
}

void YcbcrRows::yuyv(const uint8_t* from, uint32_t width, uint8_t* rgb) const {
  for (uint32_t x = 0; x < width; ++x) {
    const uint8_t* const group = from + 4 * (x / 2);
    pixel(group[2 * (x % 2)], group[1], group[3], rgb + 3 * x);
  }
}

void YcbcrRows::nv12(const uint8_t* luma, const uint8_t* chroma, uint32_t width,
                     uint8_t* rgb) const {
  for (uint32_t x = 0; x < width; ++x)
    pixel(luma[x], chroma[2 * (x / 2)], chroma[2 * (x / 2) + 1], rgb + 3 * x);
}

}  // namespace figurine::ports
