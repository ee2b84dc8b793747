#include "runtime/src/splat/pixel_layout.h"

#include <cstring>
#include <string>

#include "figurine/ycbcr.h"

namespace figurine {
namespace {

Status invalid(const std::string& what) {
  return Status(StatusCode::kInvalidArgument, "image: " + what);
}

Status validate_size(PixelFormat format, const Camera& camera) {
  const PixelLayout layout = layout_of(format);
  const auto uneven = [&](const char* side, uint32_t size) {
    return invalid(std::string(to_string(format)) + " needs an even " + side + ", not " +
                   std::to_string(size));
  };
  if (camera.width_px % layout.columns != 0) return uneven("width", camera.width_px);
  if (camera.height_px % layout.rows != 0) return uneven("height", camera.height_px);
  return {};
}

Status validate_chroma(const ImageTarget& target, const Camera& camera) {
  if (target.chroma == nullptr) return invalid("nv12 needs a plane of chroma");
  if (target.chroma_stride_bytes < camera.width_px) {
    return invalid("chroma rows of " + std::to_string(target.chroma_stride_bytes) +
                   " bytes are too short for " + std::to_string(camera.width_px) + " pixels");
  }
  const auto luma = reinterpret_cast<uintptr_t>(target.pixels),
             chroma = reinterpret_cast<uintptr_t>(target.chroma);
  const uintptr_t luma_end = luma + target.stride_bytes * (camera.height_px - 1) + camera.width_px;
  const uintptr_t chroma_end =
      chroma + target.chroma_stride_bytes * (camera.height_px / 2 - 1) + camera.width_px;
  if (luma < chroma_end && chroma < luma_end)
    return invalid("the plane of chroma lies in the plane of luma");
  return {};
}

void pack_bgra(const uint8_t* rgba, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; ++i, rgba += 4, out += 4)
    out[0] = rgba[2], out[1] = rgba[1], out[2] = rgba[0], out[3] = rgba[3];
}

void pack_rgb(const uint8_t* rgba, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; ++i, rgba += 4, out += 3)
    out[0] = rgba[0], out[1] = rgba[1], out[2] = rgba[2];
}

void pack_bgr(const uint8_t* rgba, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; ++i, rgba += 4, out += 3)
    out[0] = rgba[2], out[1] = rgba[1], out[2] = rgba[0];
}

template <YcbcrMatrix matrix>
void pack_luma(const uint8_t* rgba, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; ++i, rgba += 4)
    out[i] = luma_code<matrix>(rgba[0], rgba[1], rgba[2]);
}

template <YcbcrMatrix matrix>
void pack_yuyv(const uint8_t* rgba, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; i += 2, rgba += 8, out += 4) {
    const ChromaCodes chroma = chroma_codes<matrix, 2>(
        uint32_t(rgba[0]) + rgba[4], uint32_t(rgba[1]) + rgba[5], uint32_t(rgba[2]) + rgba[6]);
    out[0] = luma_code<matrix>(rgba[0], rgba[1], rgba[2]);
    out[1] = chroma.cb;
    out[2] = luma_code<matrix>(rgba[4], rgba[5], rgba[6]);
    out[3] = chroma.cr;
  }
}

// Two rows to one of Cb and Cr in turn.
template <YcbcrMatrix matrix>
void pack_chroma(const uint8_t* top, const uint8_t* bottom, uint32_t width, uint8_t* out) {
  for (uint32_t i = 0; i < width; i += 2, top += 8, bottom += 8, out += 2) {
    const auto sum = [&](int c) {
      return uint32_t(top[c]) + top[4 + c] + bottom[c] + bottom[4 + c];
    };
    const ChromaCodes chroma = chroma_codes<matrix, 4>(sum(0), sum(1), sum(2));
    out[0] = chroma.cb;
    out[1] = chroma.cr;
  }
}

}  // namespace

PixelLayout layout_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::kRgba8:
    case PixelFormat::kBgra8:
      return {.bytes_per_pixel = 4, .alpha = true};
    case PixelFormat::kRgbaF32:
      return {.bytes_per_pixel = 4 * sizeof(float), .alpha = true};
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return {.bytes_per_pixel = 3};
    case PixelFormat::kYuyv:
      return {.bytes_per_pixel = 2, .columns = 2};
    case PixelFormat::kNv12:
      return {.bytes_per_pixel = 1, .columns = 2, .rows = 2};
  }
  return {};
}

Status validate_target(const ImageTarget& target, const Camera& camera) {
  const PixelLayout layout = layout_of(target.format);
  if (layout.bytes_per_pixel == 0) return invalid("unknown pixel format");
  if (target.pixels == nullptr) return invalid("no pixels");
  FIG_RETURN_IF_ERROR(validate_size(target.format, camera));
  if (target.stride_bytes < layout.bytes_per_pixel * camera.width_px) {
    return invalid("rows of " + std::to_string(target.stride_bytes) + " bytes are too short for " +
                   std::to_string(camera.width_px) + " pixels");
  }
  if (target.format == PixelFormat::kRgbaF32 &&
      (target.stride_bytes % alignof(float) != 0 ||
       reinterpret_cast<uintptr_t>(target.pixels) % alignof(float) != 0)) {
    return invalid("float pixels must be aligned to 4 bytes");
  }
  if (target.matrix != YcbcrMatrix::kBt709 && target.matrix != YcbcrMatrix::kBt601)
    return invalid("unknown matrix of colours");
  return target.format == PixelFormat::kNv12 ? validate_chroma(target, camera) : Status();
}

void pack_rows(const uint8_t* codes, size_t stride_bytes, uint32_t x, uint32_t y, uint32_t width,
               uint32_t rows, const ImageTarget& target) {
  const bool sd = target.matrix == YcbcrMatrix::kBt601;
  const size_t bytes_per_pixel = layout_of(target.format).bytes_per_pixel;
  for (uint32_t row = 0; row < rows; ++row) {
    const uint8_t* rgba = codes + row * stride_bytes;
    uint8_t* out = static_cast<uint8_t*>(target.pixels) + (size_t(y) + row) * target.stride_bytes +
                   x * bytes_per_pixel;
    switch (target.format) {
      case PixelFormat::kBgra8:
        pack_bgra(rgba, width, out);
        break;
      case PixelFormat::kRgb24:
        pack_rgb(rgba, width, out);
        break;
      case PixelFormat::kBgr24:
        pack_bgr(rgba, width, out);
        break;
      case PixelFormat::kYuyv:
        sd ? pack_yuyv<YcbcrMatrix::kBt601>(rgba, width, out)
           : pack_yuyv<YcbcrMatrix::kBt709>(rgba, width, out);
        break;
      case PixelFormat::kNv12:
        sd ? pack_luma<YcbcrMatrix::kBt601>(rgba, width, out)
           : pack_luma<YcbcrMatrix::kBt709>(rgba, width, out);
        break;
      case PixelFormat::kRgba8:
      case PixelFormat::kRgbaF32:
        FIG_DCHECK(false, "the kernel writes these itself");
        break;
    }
  }
  if (target.format != PixelFormat::kNv12) return;
  uint8_t* chroma =
      static_cast<uint8_t*>(target.chroma) + size_t(y / 2) * target.chroma_stride_bytes + x;
  sd ? pack_chroma<YcbcrMatrix::kBt601>(codes, codes + stride_bytes, width, chroma)
     : pack_chroma<YcbcrMatrix::kBt709>(codes, codes + stride_bytes, width, chroma);
}

}  // namespace figurine
