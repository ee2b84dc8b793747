#include "ports/media/y4m.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace figurine::ports {

namespace {

// 16-bit fixed point would be enough for 8-bit codes, but rounding is then off by one here and
// there; doubles are exact to the code.
struct Matrix {
  double red, blue;  // Kr, Kb
  double luma(const double* rgb) const {
    return red * rgb[0] + (1 - red - blue) * rgb[1] + blue * rgb[2];
  }
};

Matrix matrix_for(uint32_t height_px) {
  return height_px <= 576 ? Matrix{0.299, 0.114} : Matrix{0.2126, 0.0722};
}

uint8_t code(double offset, double range, double value) {
  return static_cast<uint8_t>(std::lround(offset + range * value));
}

}  // namespace

Result<FrameRate> make_frame_rate(double frames_per_second) {
  if (!(frames_per_second >= 0.01 && frames_per_second <= 1000)) {
    return Status(StatusCode::kInvalidArgument,
                  "frame rate: must be between 0.01 and 1000 a second");
  }
  for (const uint32_t denominator : {1u, 2u, 1001u}) {
    const double numerator =
        std::round(frames_per_second * denominator / (denominator == 1001 ? 1000.0 : 1.0)) *
        (denominator == 1001 ? 1000 : 1);
    if (std::abs(numerator / denominator - frames_per_second) < 5e-4)
      return FrameRate{static_cast<uint32_t>(numerator), denominator};
  }
  const auto thousandths = static_cast<uint32_t>(std::lround(frames_per_second * 1000));
  const uint32_t common = std::gcd(thousandths, 1000u);
  return FrameRate{thousandths / common, 1000 / common};
}

std::string y4m_header(uint32_t width_px, uint32_t height_px, FrameRate rate) {
  return "YUV4MPEG2 W" + std::to_string(width_px) + " H" + std::to_string(height_px) + " F" +
         std::to_string(rate.numerator) + ":" + std::to_string(rate.denominator) +
         " Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
}

void append_y4m_frame(const ImageU8& image, std::vector<std::byte>& out) {
  FIG_CHECK(image.sound() && image.channels == 3, "y4m frames are made of RGB images");
  const Matrix matrix = matrix_for(image.height_px);
  const uint32_t width = image.width_px, height = image.height_px, half_width = (width + 1) / 2,
                 half_height = (height + 1) / 2;
  constexpr char kMarker[] = "FRAME\n";
  const size_t start = out.size(), marker = sizeof(kMarker) - 1, luma_size = size_t(width) * height,
               chroma_size = size_t(half_width) * half_height;
  out.resize(start + marker + luma_size + 2 * chroma_size);
  std::memcpy(out.data() + start, kMarker, marker);
  auto* luma = reinterpret_cast<uint8_t*>(out.data()) + start + marker;
  uint8_t* blue = luma + luma_size;
  uint8_t* red = blue + chroma_size;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const uint8_t* pixel = image.at(x, y);
      const double rgb[3] = {pixel[0] / 255.0, pixel[1] / 255.0, pixel[2] / 255.0};
      luma[size_t(y) * width + x] = code(16, 219, matrix.luma(rgb));
    }
  }
  for (uint32_t y = 0; y < half_height; ++y) {
    for (uint32_t x = 0; x < half_width; ++x) {
      const uint32_t x0 = 2 * x, x1 = std::min(x0 + 1, width - 1), y0 = 2 * y,
                     y1 = std::min(y0 + 1, height - 1);
      const uint8_t* block[4] = {image.at(x0, y0), image.at(x1, y0), image.at(x0, y1),
                                 image.at(x1, y1)};
      double rgb[3];
      for (int c = 0; c < 3; ++c)
        rgb[c] = (block[0][c] + block[1][c] + block[2][c] + block[3][c]) / (4 * 255.0);
      const double mean = matrix.luma(rgb);
      blue[size_t(y) * half_width + x] = code(128, 224, (rgb[2] - mean) / (2 * (1 - matrix.blue)));
      red[size_t(y) * half_width + x] = code(128, 224, (rgb[0] - mean) / (2 * (1 - matrix.red)));
    }
  }
}

}  // namespace figurine::ports
