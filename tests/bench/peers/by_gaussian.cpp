#include <algorithm>
#include <cmath>
#include <numeric>

#include "bench/peers/peer.h"

namespace figurine::peers {

void draw_by_gaussian(const GaussianView& gaussians, const Camera& camera, Peer& peer) {
  const uint32_t width = camera.width_px, height = camera.height_px;
  project(gaussians, camera, peer.projected);
  peer.order.resize(peer.projected.size());
  std::iota(peer.order.begin(), peer.order.end(), 0u);
  std::stable_sort(peer.order.begin(), peer.order.end(), [&](uint32_t i, uint32_t j) {
    return peer.projected[i].depth < peer.projected[j].depth;
  });
  peer.rgb.assign(size_t{3} * width * height, 0.0f);
  peer.transmittance.assign(size_t{width} * height, 1.0f);
  for (const uint32_t index : peer.order) {
    const Projected& splat = peer.projected[index];
    const auto bound = [](float at, uint32_t size) {
      return static_cast<uint32_t>(std::clamp(at, 0.0f, static_cast<float>(size)));
    };
    const uint32_t x_begin = bound(splat.x - splat.radius, width),
                   x_end = bound(splat.x + splat.radius + 1, width),
                   y_begin = bound(splat.y - splat.radius, height),
                   y_end = bound(splat.y + splat.radius + 1, height);
    for (uint32_t y = y_begin; y < y_end; ++y) {
      const float dy = static_cast<float>(y) + 0.5f - splat.y;
      for (uint32_t x = x_begin; x < x_end; ++x) {
        const size_t pixel = size_t{y} * width + x;
        float& transmittance = peer.transmittance[pixel];
        if (transmittance < 0) continue;  // stopped
        const float dx = static_cast<float>(x) + 0.5f - splat.x;
        const float sigma = 0.5f * (splat.a * dx * dx + splat.c * dy * dy) + splat.b * dx * dy;
        if (sigma < 0) continue;
        const float alpha = std::min(kAlphaMax, splat.opacity * std::exp(-sigma));
        if (alpha < kAlphaCut) continue;
        const float next = transmittance * (1 - alpha);
        if (next < kTransmittanceStop) {
          transmittance = -transmittance;
          continue;
        }
        const float share = transmittance * alpha;
        peer.rgb[3 * pixel] += share * splat.red;
        peer.rgb[3 * pixel + 1] += share * splat.green;
        peer.rgb[3 * pixel + 2] += share * splat.blue;
        transmittance = next;
      }
    }
  }
}

}  // namespace figurine::peers
