#include "runtime/src/splat/resolve.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "runtime/src/splat/pixel_layout.h"

namespace figurine {
namespace {

// One row of a tile in which nothing was blended: all rows of all such tiles are alike.
void resolve_empty_row(const KernelTable& kernels, int32_t width, const float* background,
                       kernels::ResolveFormat format, uint8_t* out) {
  // Light passes whole: no colour, transmittance one. Only the first row is read.
  kernels::TilePixels empty;
  std::fill_n(empty.red, kernels::kTileSize, 0.0f);
  std::fill_n(empty.green, kernels::kTileSize, 0.0f);
  std::fill_n(empty.blue, kernels::kTileSize, 0.0f);
  std::fill_n(empty.transmittance, kernels::kTileSize, 1.0f);
  kernels.resolve_rows({.pixels = &empty,
                        .first_row = 0,
                        .rows = 1,
                        .width = width,
                        .background = background,
                        .format = format,
                        .out = out,
                        .stride_bytes = 0});
}

// Through rows of RGBA8 codes, two at a time: rows that share chroma lie in one tile, because a
// tile's first row is even.
void resolve_packed(const KernelTable& kernels, const TileArea& area,
                    const kernels::TilePixels* pixels, const float* background,
                    const ImageTarget& target) {
  constexpr size_t kStride = 4 * kernels::kTileSize;
  alignas(64) uint8_t codes[2 * kStride];
  if (pixels == nullptr) {
    resolve_empty_row(kernels, area.width, background, kernels::kResolveRgba8, codes);
    std::memcpy(codes + kStride, codes, 4 * static_cast<size_t>(area.width));
  }
  for (int32_t row = 0; row < area.height; row += 2) {
    const int32_t rows = std::min(2, area.height - row);
    if (pixels != nullptr) {
      kernels.resolve_rows({.pixels = pixels,
                            .first_row = row,
                            .rows = rows,
                            .width = area.width,
                            .background = background,
                            .format = kernels::kResolveRgba8,
                            .out = codes,
                            .stride_bytes = kStride});
    }
    pack_rows(codes, kStride, static_cast<uint32_t>(area.x), static_cast<uint32_t>(area.y + row),
              static_cast<uint32_t>(area.width), static_cast<uint32_t>(rows), target);
  }
}

}  // namespace

void resolve_tile(const KernelTable& kernels, const TileArea& area,
                  const kernels::TilePixels* pixels,
                  const std::optional<std::array<float, 3>>& background,
                  const ImageTarget& target) {
  const float* const behind = background ? background->data() : nullptr;
  const bool bytes = target.format == PixelFormat::kRgba8;
  if (!bytes && target.format != PixelFormat::kRgbaF32)
    return resolve_packed(kernels, area, pixels, behind, target);
  const size_t pixel_bytes = layout_of(target.format).bytes_per_pixel;
  const kernels::ResolveFormat format = bytes ? kernels::kResolveRgba8 : kernels::kResolveRgbaF32;
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
