#include "ports/media/y4m.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "ports/media/yuv.h"

namespace figurine::ports {

namespace {

YcbcrMatrix matrix_for(uint32_t height_px) {
  return height_px <= 576 ? YcbcrMatrix::kBt601 : YcbcrMatrix::kBt709;
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
  const YcbcrMatrix matrix = matrix_for(image.height_px);
  const size_t width = image.width_px, height = image.height_px, half_width = (width + 1) / 2,
               half_height = (height + 1) / 2;
  constexpr char kMarker[] = "FRAME\n";
  const size_t start = out.size(), marker = sizeof(kMarker) - 1, luma_size = width * height,
               chroma_size = half_width * half_height;
  out.resize(start + marker + luma_size + 2 * chroma_size);
  std::memcpy(out.data() + start, kMarker, marker);
  const std::span<uint8_t> planes(reinterpret_cast<uint8_t*>(out.data()) + start + marker,
                                  luma_size + 2 * chroma_size);
  const auto row = [&](size_t y) {
    return std::span(image.pixels).subspan(3 * width * std::min(y, height - 1), 3 * width);
  };
  for (size_t y = 0; y < height; ++y) luma_row(row(y), matrix, planes.subspan(y * width, width));
  const std::span<uint8_t> blue = planes.subspan(luma_size, chroma_size),
                           red = planes.subspan(luma_size + chroma_size);
  for (size_t y = 0; y < half_height; ++y) {
    chroma_row(row(2 * y), row(2 * y + 1), matrix, blue.subspan(y * half_width, half_width),
               red.subspan(y * half_width, half_width));
  }
}

}  // namespace figurine::ports
