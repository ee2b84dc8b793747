// A blended tile to the caller's pixels: straight colour and alpha, or colour over a background.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "figurine/frame.h"
#include "runtime/src/kernels/table.h"

namespace figurine {

// A tile of the image: its first pixel and the pixels of it that are inside.
struct TileArea {
  int32_t x, y, width, height;
};

// Writes the tile's pixels. Null pixels: nothing was blended there. kRgba8 rounds to nearest and
// clamps, kRgbaF32 does neither, all others are kRgba8's codes packed (pixel_layout.h). Where
// nothing was blended and there is no background, all four channels are 0.
void resolve_tile(const KernelTable& kernels, const TileArea& area,
                  const kernels::TilePixels* pixels,
                  const std::optional<std::array<float, 3>>& background, const ImageTarget& target);

}  // namespace figurine
