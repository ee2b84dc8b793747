#include "runtime/src/splat/resolve.h"

#include <cstddef>
#include <cstring>

namespace figurine {
namespace {

// One row of a tile in which nothing was blended: all rows of all such tiles are alike.
void resolve_empty_row(const KernelTable& kernels, int32_t width, const float* background,
                       kernels::ResolveFormat format, uint8_t* out) {
  // Light passes whole, so colours are zero and transmittances one; a row of them is enough.
  static const kernels::TilePixels empty = [] {
    kernels::TilePixels pixels{};
    for (float& transmittance : pixels.transmittance) transmittance = 1;
    return pixels;
  }();
  kernels.resolve_rows({.pixels = &empty,
                        .first_row = 0,
                        .rows = 1,
                        .width = width,
                        .background = background,
                        .format = format,
                        .out = out,
                        .stride_bytes = 0});
}

}  // namespace

void resolve_tile(const KernelTable& kernels, const TileArea& area,
                  const kernels::TilePixels* pixels,
                  const std::optional<std::array<float, 3>>& background,
                  const ImageTarget& target) {
  const bool bytes = target.format == PixelFormat::kRgba8;
  const size_t pixel_bytes = bytes ? 4 : 4 * sizeof(float);
  const kernels::ResolveFormat format = bytes ? kernels::kResolveRgba8 : kernels::kResolveRgbaF32;
  const float* const behind = background ? background->data() : nullptr;
  uint8_t* const first = static_cast<uint8_t*>(target.pixels) +
                         static_cast<size_t>(area.y) * target.stride_bytes +
                         static_cast<size_t>(area.x) * pixel_bytes;
  if (pixels != nullptr) {
    kernels.resolve_rows({.pixels = pixels,
                          .first_row = 0,
                          .rows = area.height,
                          .width = area.width,
                          .background = behind,
                          .format = format,
                          .out = first,
                          .stride_bytes = target.stride_bytes});
    return;
  }
  resolve_empty_row(kernels, area.width, behind, format, first);
  for (int32_t row = 1; row < area.height; ++row) {
    std::memcpy(first + static_cast<size_t>(row) * target.stride_bytes, first,
                static_cast<size_t>(area.width) * pixel_bytes);
  }
}

}  // namespace figurine
