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

RenderedFrame::RenderedFrame(ImageSize image_size, PixelFormat pixel_format)
    : format(pixel_format), size(image_size) {
  const size_t pixels = size_t(size.width_px) * size.height_px;
  switch (format) {
    case PixelFormat::kRgba8:
      u8 = ports::ImageU8(size.width_px, size.height_px, 4);
      break;
    case PixelFormat::kRgb24:
      u8 = ports::ImageU8(size.width_px, size.height_px, 3);
      break;
    case PixelFormat::kRgbaF32:
      f32 = ports::ImageF32(size.width_px, size.height_px, 4);
      break;
    case PixelFormat::kBgra8:
      packed.resize(4 * pixels);
      break;
    case PixelFormat::kBgr24:
      packed.resize(3 * pixels);
      break;
    case PixelFormat::kYuyv:
      packed.resize(2 * pixels);
      break;
    case PixelFormat::kNv12:
      packed.resize(pixels + pixels / 2);
      break;
  }
}

ImageTarget RenderedFrame::target() {
  if (format == PixelFormat::kRgbaF32) {
    return {.pixels = f32.pixels.data(),
            .stride_bytes = size_t(size.width_px) * 4 * sizeof(float),
            .format = format};
  }
  if (!u8.pixels.empty()) {
    return {.pixels = u8.pixels.data(),
            .stride_bytes = size_t(size.width_px) * u8.channels,
            .format = format};
  }
  if (format != PixelFormat::kNv12) {
    return {
        .pixels = packed.data(), .stride_bytes = packed.size() / size.height_px, .format = format};
  }
  return {.pixels = packed.data(),
          .stride_bytes = size.width_px,
          .format = format,
          .chroma = packed.data() + size_t(size.width_px) * size.height_px,
          .chroma_stride_bytes = size.width_px};
}

ports::ImageU8 drop_alpha(const ports::ImageU8& rgba) { return without_alpha(rgba); }
ports::ImageF32 drop_alpha(const ports::ImageF32& rgba) { return without_alpha(rgba); }

}  // namespace figurine::samples
