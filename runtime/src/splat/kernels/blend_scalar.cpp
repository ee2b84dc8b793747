// The blend, in scalar code: the specification of every later kernel.
//
// Per splat and row, the ellipse's exact span; per pixel of the span, alpha, the cut, the stop, the sum. The span only skips pixels that
// the cut would reject anyway (reach has slack for rounding), so the picture does not depend on it. Based on: Kerbl et al., 3D Gaussian
// Splatting for Real-Time Radiance Field Rendering, 2023, eq. 3 (front-to-back alpha blending) and its rasterizer's constants in
// figurine/gaussian.h.
#include <cmath>

#include "figurine/gaussian.h"
#include "runtime/src/float_math.h"
#include "runtime/src/splat/kernels/blend.h"

namespace figurine::kernels {
namespace {

// Smallest integer >= value and largest integer <= value, first clamped to [low, high]. Written out because ceilf and floorf are library
// calls on baseline x86-64.
int32_t ceil_within(float value, int32_t low, int32_t high) {
  value = value > static_cast<float>(low) ? value : static_cast<float>(low);
  value = value < static_cast<float>(high) ? value : static_cast<float>(high);
  const int32_t truncated = static_cast<int32_t>(value);
  return truncated + (static_cast<float>(truncated) < value ? 1 : 0);
}

int32_t floor_within(float value, int32_t low, int32_t high) {
  value = value > static_cast<float>(low) ? value : static_cast<float>(low);
  value = value < static_cast<float>(high) ? value : static_cast<float>(high);
  const int32_t truncated = static_cast<int32_t>(value);
  return truncated - (static_cast<float>(truncated) > value ? 1 : 0);
}

}  // namespace

uint64_t blend_tile_scalar(const Tile& tile) {
  uint64_t blends = 0;
  int32_t live = tile.width * tile.height;
  const int32_t last_x = tile.x + tile.width - 1, last_y = tile.y + tile.height - 1;

  for (uint32_t i = 0; i < tile.count && live > 0; ++i) {
    const Splat splat = tile.splats[tile.order[i]];
    const int32_t y_begin = ceil_within(splat.mean_y - splat.half_height - 0.5f, tile.y, last_y + 1);
    const int32_t y_end = floor_within(splat.mean_y + splat.half_height - 0.5f, tile.y - 1, last_y);
    for (int32_t y = y_begin; y <= y_end; ++y) {
      const float dy = (static_cast<float>(y) + 0.5f) - splat.mean_y;
      const float v = dy * splat.scale_v, v2 = v * v;
      const float room = splat.reach - v2;
      if (!(room > 0)) continue;
      const float half_width = std::sqrt(room) * splat.inverse_scale_u;
      const float centre = splat.mean_x + splat.slope * dy;
      const int32_t x_begin = ceil_within(centre - half_width - 0.5f, tile.x, last_x + 1);
      const int32_t x_end = floor_within(centre + half_width - 0.5f, tile.x - 1, last_x);
      Pixel* row = tile.pixels + (y - tile.y) * kTileSize - tile.x;
      for (int32_t x = x_begin; x <= x_end; ++x) {
        Pixel& pixel = row[x];
        const float transmittance = pixel.transmittance;
        if (!(transmittance > 0)) continue;
        const float u = ((static_cast<float>(x) + 0.5f) - centre) * splat.scale_u;
        float alpha = splat.opacity * exp2_nonpositive(-(u * u + v2));
        if (!(alpha >= tile.alpha_cut)) continue;
        alpha = alpha < kAlphaMax ? alpha : kAlphaMax;
        const float next = transmittance * (1.0f - alpha);
        if (next < kTransmittanceStop) {
          pixel.transmittance = -transmittance;
          --live;
          continue;
        }
        const float weight = transmittance * alpha;
        pixel.red += weight * splat.red;
        pixel.green += weight * splat.green;
        pixel.blue += weight * splat.blue;
        pixel.transmittance = next;
        ++blends;
      }
    }
  }
  return blends;
}

}  // namespace figurine::kernels
