#include "runtime/src/splat/resolve.h"

#include <cmath>
#include <cstring>

namespace figurine {
namespace {

using Rgba = std::array<float, 4>;

uint8_t to_byte(float value) {
  value = value > 0 ? value : 0;  // NaN too
  value = value < 1 ? value : 1;
  return static_cast<uint8_t>(static_cast<int32_t>(value * 255.0f + 0.5f));
}

Rgba over_background(float red, float green, float blue, float transmittance,
                     const std::array<float, 3>& background) {
  return {red + transmittance * background[0], green + transmittance * background[1],
          blue + transmittance * background[2], 1.0f};
}

Rgba straight(float red, float green, float blue, float transmittance) {
  const float alpha = 1.0f - transmittance;
  if (!(alpha > 0)) return {0, 0, 0, 0};
  return {red / alpha, green / alpha, blue / alpha, alpha};
}

struct BytePixels {
  static constexpr size_t kSize = 4;
  static void store(const Rgba& rgba, std::byte* out) {
    const uint8_t bytes[4] = {to_byte(rgba[0]), to_byte(rgba[1]), to_byte(rgba[2]),
                              to_byte(rgba[3])};
    std::memcpy(out, bytes, sizeof(bytes));
  }
};

struct FloatPixels {
  static constexpr size_t kSize = 16;
  static void store(const Rgba& rgba, std::byte* out) { std::memcpy(out, rgba.data(), kSize); }
};

template <class Format>
void resolve(const kernels::Tile& tile, const std::optional<std::array<float, 3>>& background,
             const ImageTarget& target) {
  const kernels::TilePixels& pixels = *tile.pixels;
  for (int32_t y = 0; y < tile.height; ++y) {
    std::byte* out = static_cast<std::byte*>(target.pixels) +
                     size_t(tile.y + y) * target.stride_bytes + size_t(tile.x) * Format::kSize;
    const size_t first = size_t(y) * kernels::kTileSize, end = first + size_t(tile.width);
    if (background) {
      for (size_t i = first; i < end; ++i, out += Format::kSize) {
        Format::store(over_background(pixels.red[i], pixels.green[i], pixels.blue[i],
                                      std::fabs(pixels.transmittance[i]), *background),
                      out);
      }
    } else {
      for (size_t i = first; i < end; ++i, out += Format::kSize) {
        Format::store(straight(pixels.red[i], pixels.green[i], pixels.blue[i],
                               std::fabs(pixels.transmittance[i])),
                      out);
      }
    }
  }
}

// A tile without splats is one colour.
template <class Format>
void fill(const kernels::Tile& tile, const std::optional<std::array<float, 3>>& background,
          const ImageTarget& target) {
  std::byte pixel[Format::kSize];
  Format::store(background ? over_background(0, 0, 0, 1, *background) : straight(0, 0, 0, 1),
                pixel);
  for (int32_t y = 0; y < tile.height; ++y) {
    std::byte* out = static_cast<std::byte*>(target.pixels) +
                     size_t(tile.y + y) * target.stride_bytes + size_t(tile.x) * Format::kSize;
    for (int32_t x = 0; x < tile.width; ++x)
      std::memcpy(out + size_t(x) * Format::kSize, pixel, Format::kSize);
  }
}

}  // namespace

void resolve_tile(const kernels::Tile& tile, const std::optional<std::array<float, 3>>& background,
                  const ImageTarget& target) {
  const bool bytes = target.format == PixelFormat::kRgba8;
  if (tile.count == 0) {
    bytes ? fill<BytePixels>(tile, background, target)
          : fill<FloatPixels>(tile, background, target);
  } else {
    bytes ? resolve<BytePixels>(tile, background, target)
          : resolve<FloatPixels>(tile, background, target);
  }
}

}  // namespace figurine
