#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "bench/peers/peer.h"

namespace figurine::peers {
namespace {

constexpr uint32_t kTile = 16;

struct TilePixels {
  alignas(64) float red[kTile][kTile], green[kTile][kTile], blue[kTile][kTile],
      transmittance[kTile][kTile];
};

// e^-x of x >= 0 as a compiler can make vectors of it: 2^n times a polynomial of degree 5.
inline float exp_minus(float x) {
  x = std::min(x * 1.44269504f, 120.0f);
  const float n = (x + 12582912.0f) - 12582912.0f, f = n - x;
  float p = 1.3333558e-3f;
  p = p * f + 9.6181291e-3f;
  p = p * f + 5.5504109e-2f;
  p = p * f + 2.4022651e-1f;
  p = p * f + 6.9314718e-1f;
  p = p * f + 1.0f;
  return p * std::bit_cast<float>((127 - static_cast<int32_t>(n)) << 23);
}

void blend(const Projected& splat, float left, float top, TilePixels& tile) {
  for (uint32_t row = 0; row < kTile; ++row) {
    const float dy = top + static_cast<float>(row) + 0.5f - splat.y;
    float* __restrict red = tile.red[row];
    float* __restrict green = tile.green[row];
    float* __restrict blue = tile.blue[row];
    float* __restrict light = tile.transmittance[row];
    for (uint32_t column = 0; column < kTile; ++column) {
      const float dx = left + static_cast<float>(column) + 0.5f - splat.x;
      const float sigma = 0.5f * (splat.a * dx * dx + splat.c * dy * dy) + splat.b * dx * dy;
      const float weight = splat.opacity * exp_minus(std::max(sigma, 0.0f));
      const float alpha = weight < kAlphaMax ? weight : kAlphaMax;
      const float before = light[column] > 0 ? light[column] : 0.0f;
      const float met = weight >= kAlphaCut ? before : 0.0f;
      const float after = met * (1 - alpha);
      const bool goes_on = after >= kTransmittanceStop;
      const float share = goes_on ? met * alpha : 0.0f;
      red[column] += share * splat.red;
      green[column] += share * splat.green;
      blue[column] += share * splat.blue;
      light[column] = goes_on ? after : light[column] - 2 * met;
    }
  }
}

bool has_stopped(const TilePixels& tile) {
  float most = -1;
  for (const auto& row : tile.transmittance) {
    for (const float light : row) most = std::max(most, light);
  }
  return most <= 0;
}

}  // namespace

void draw_by_rows(const GaussianView& gaussians, const Camera& camera, Peer& peer) {
  const uint32_t width = camera.width_px, height = camera.height_px;
  const uint32_t tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
  project(gaussians, camera, peer.projected);
  // (tile, depth) as one number, the index beside it: sorted together as on GPUs.
  std::vector<Peer::Pair>& pairs = peer.pairs;
  pairs.clear();
  for (uint32_t i = 0; i < peer.projected.size(); ++i) {
    const Projected& splat = peer.projected[i];
    const auto tile_of = [](float at, uint32_t tiles) {
      return static_cast<uint32_t>(std::clamp(at / kTile, 0.0f, static_cast<float>(tiles)));
    };
    const uint32_t x_begin = tile_of(splat.x - splat.radius, tiles_x),
                   x_end = tile_of(splat.x + splat.radius + kTile - 1, tiles_x),
                   y_begin = tile_of(splat.y - splat.radius, tiles_y),
                   y_end = tile_of(splat.y + splat.radius + kTile - 1, tiles_y);
    for (uint32_t y = y_begin; y < y_end; ++y) {
      for (uint32_t x = x_begin; x < x_end; ++x) {
        pairs.push_back(
            {uint64_t{y * tiles_x + x} << 32 | std::bit_cast<uint32_t>(splat.depth), i});
      }
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Peer::Pair& a, const Peer::Pair& b) {
    return a.key != b.key ? a.key < b.key : a.index < b.index;
  });
  peer.rgb.assign(size_t{3} * width * height, 0.0f);
  for (size_t begin = 0, end = 0; begin < pairs.size(); begin = end) {
    const uint32_t tile = static_cast<uint32_t>(pairs[begin].key >> 32);
    while (end < pairs.size() && pairs[end].key >> 32 == tile) ++end;
    const uint32_t left = tile % tiles_x * kTile, top = tile / tiles_x * kTile;
    TilePixels pixels;
    std::memset(&pixels, 0, sizeof(pixels));
    for (auto& row : pixels.transmittance) std::fill_n(row, kTile, 1.0f);
    for (size_t i = begin; i < end; ++i) {
      if (i % 16 == 15 && has_stopped(pixels)) break;
      blend(peer.projected[pairs[i].index], static_cast<float>(left), static_cast<float>(top),
            pixels);
    }
    for (uint32_t y = top; y < std::min(top + kTile, height); ++y) {
      for (uint32_t x = left; x < std::min(left + kTile, width); ++x) {
        float* to = peer.rgb.data() + 3 * (size_t{y} * width + x);
        to[0] = pixels.red[y - top][x - left];
        to[1] = pixels.green[y - top][x - left];
        to[2] = pixels.blue[y - top][x - left];
      }
    }
  }
}

}  // namespace figurine::peers
