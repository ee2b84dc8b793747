// A blended tile to the caller's pixels: straight colour and alpha, or colour over a background.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "figurine/frame.h"
#include "runtime/src/splat/kernels/blend.h"

namespace figurine {

// Writes tile.width x tile.height pixels; the pixels of a tile without splats are not read. kRgba8
// rounds to nearest and clamps, kRgbaF32 does neither. Where nothing was blended and there is no
// background, all four channels are 0.
void resolve_tile(const kernels::Tile& tile, const std::optional<std::array<float, 3>>& background,
                  const ImageTarget& target);

}  // namespace figurine
