#include "runtime/src/splat/resolve.h"

#include <cmath>

namespace figurine {
namespace {

uint8_t to_byte(float value) {
  if (!(value > 0)) return 0;
  if (value >= 1) return 255;
  return static_cast<uint8_t>(value * 255.0f + 0.5f);
}

std::array<float, 4> resolve(const kernels::Pixel& pixel, const std::optional<std::array<float, 3>>& background) {
  const float transmittance = std::fabs(pixel.transmittance);
  if (background) {
    return {pixel.red + transmittance * (*background)[0], pixel.green + transmittance * (*background)[1],
            pixel.blue + transmittance * (*background)[2], 1.0f};
  }
  const float alpha = 1.0f - transmittance;
  if (!(alpha > 0)) return {0, 0, 0, 0};
  return {pixel.red / alpha, pixel.green / alpha, pixel.blue / alpha, alpha};
}

}  // namespace

void resolve_tile(const kernels::Tile& tile, const std::optional<std::array<float, 3>>& background, const ImageTarget& target) {
  for (int32_t y = 0; y < tile.height; ++y) {
    std::byte* row = static_cast<std::byte*>(target.pixels) + size_t(tile.y + y) * target.stride_bytes;
    const kernels::Pixel* pixels = tile.pixels + y * kernels::kTileSize;
    if (target.format == PixelFormat::kRgba8) {
      uint8_t* out = reinterpret_cast<uint8_t*>(row) + size_t(tile.x) * 4;
      for (int32_t x = 0; x < tile.width; ++x, out += 4) {
        const std::array<float, 4> rgba = resolve(pixels[x], background);
        for (int c = 0; c < 4; ++c) out[c] = to_byte(rgba[c]);
      }
    } else {
      float* out = reinterpret_cast<float*>(row) + size_t(tile.x) * 4;
      for (int32_t x = 0; x < tile.width; ++x, out += 4) {
        const std::array<float, 4> rgba = resolve(pixels[x], background);
        for (int c = 0; c < 4; ++c) out[c] = rgba[c];
      }
    }
  }
}

}  // namespace figurine
