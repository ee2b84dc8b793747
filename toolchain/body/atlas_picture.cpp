#include "toolchain/body/atlas_picture.h"

#include <algorithm>

namespace figurine::body {
namespace {

using Rgb = std::array<uint8_t, 3>;

constexpr uint32_t kLeastSize_px = 512;
constexpr std::array<Rgb, kBodyPartCount> kColours = {
    {{74, 118, 196}, {204, 72, 80}, {214, 184, 56}, {232, 132, 44}, {140, 92, 184}, {72, 160, 96}}};

Rgb mix_with_white(Rgb colour, int white_percent) {
  for (uint8_t& value : colour)
    value = static_cast<uint8_t>(value + (255 - value) * white_percent / 100);
  return colour;
}

// [F] colours of the charts.
std::vector<Rgb> triangle_colours(const Surface& surface) {
  std::vector<Rgb> colours(surface.triangle_count(), Rgb{});
  std::array<int, kBodyPartCount> seen{};
  for (const Chart& chart : find_charts(surface)) {
    const auto part = static_cast<size_t>(chart.part);
    const Rgb colour = mix_with_white(kColours[part], 20 * (seen[part]++ % 2));
    for (uint32_t t : chart.triangles) colours[t] = colour;
  }
  return colours;
}

}  // namespace

ports::ImageU8 draw_atlas(const Surface& surface, const TexelBody& texels) {
  const uint32_t size = texels.uv_size, pixels = (kLeastSize_px + size - 1) / size;
  const std::vector<Rgb> colours = triangle_colours(surface);
  ports::ImageU8 image(size * pixels, size * pixels, 3);
  std::fill(image.pixels.begin(), image.pixels.end(), uint8_t{255});
  const auto fill = [&](uint32_t texel, const Rgb& colour) {
    for (uint32_t y = 0; y < pixels; ++y) {
      for (uint32_t x = 0; x < pixels; ++x)
        std::copy(colour.begin(), colour.end(),
                  image.at(texel % size * pixels + x, texel / size * pixels + y));
    }
  };
  for (size_t row = 0; row < texels.texel.size(); ++row)
    fill(texels.texel[row], colours[texels.triangle[row]]);
  for (size_t i = 0; i < texels.border_texel.size(); ++i) {
    fill(texels.border_texel[i],
         mix_with_white(colours[texels.triangle[texels.border_source[i]]], 65));
  }
  return image;
}

}  // namespace figurine::body
