#include "samples/common/rendered_frame.h"

namespace figurine::samples {

namespace {

template <class T>
ports::Image<T> without_alpha(const ports::Image<T>& rgba) {
  ports::Image<T> rgb(rgba.width_px, rgba.height_px, 3);
  for (size_t i = 0; i < size_t(rgba.width_px) * rgba.height_px; ++i) {
    for (int c = 0; c < 3; ++c) rgb.pixels[3 * i + c] = rgba.pixels[4 * i + c];
  }
  return rgb;
}

}  // namespace

RenderedFrame::RenderedFrame(ImageSize size, PixelFormat pixel_format) : format(pixel_format) {
  if (format == PixelFormat::kRgba8) {
    u8 = ports::ImageU8(size.width_px, size.height_px, 4);
  } else {
    f32 = ports::ImageF32(size.width_px, size.height_px, 4);
  }
}

ImageTarget RenderedFrame::target() {
  if (format == PixelFormat::kRgba8)
    return {.pixels = u8.pixels.data(), .stride_bytes = size_t(u8.width_px) * 4, .format = format};
  return {.pixels = f32.pixels.data(),
          .stride_bytes = size_t(f32.width_px) * 4 * sizeof(float),
          .format = format};
}

ports::ImageU8 drop_alpha(const ports::ImageU8& rgba) { return without_alpha(rgba); }
ports::ImageF32 drop_alpha(const ports::ImageF32& rgba) { return without_alpha(rgba); }

}  // namespace figurine::samples
