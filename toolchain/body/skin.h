// Skin weights of one point: collects any number of influences and keeps the K heaviest,
// renormalised.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>

#include "figurine/pose.h"
#include "toolchain/body/skeleton.h"

namespace figurine::body {

class SkinAccumulator {
 public:
  void add(uint32_t joint, double weight) { sum_[joint] += weight; }

  // Number of joints with a positive weight.
  int influence_count() const {
    return static_cast<int>(
        std::count_if(sum_.begin(), sum_.end(), [](double w) { return w > 0; }));
  }

  // Writes kSkinInfluences joints and weights, heaviest first (ties: lower joint first), summing to
  // 1; unused entries are joint 0 with weight 0. A point without influence hangs on the root.
  // Returns the share of weight that the kept influences do not hold.
  double store(uint8_t* joints, float* weights, uint32_t keep = kSkinInfluences) const {
    std::array<uint8_t, kJointCount> order;
    std::iota(order.begin(), order.end(), uint8_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](uint8_t a, uint8_t b) { return sum_[a] > sum_[b]; });
    const double total = std::accumulate(sum_.begin(), sum_.end(), 0.0);
    double kept = 0;
    for (uint32_t k = 0; k < keep; ++k) kept += sum_[order[k]];
    for (uint32_t k = 0; k < kSkinInfluences; ++k) {
      const bool used = k < keep && kept > 0 && sum_[order[k]] > 0;
      joints[k] = used ? order[k] : uint8_t{0};
      weights[k] = used ? static_cast<float>(sum_[order[k]] / kept) : 0.0f;
    }
    if (kept <= 0) weights[0] = 1.0f;
    return total > 0 ? 1.0 - kept / total : 0.0;
  }

 private:
  std::array<double, kJointCount> sum_{};  // negative weights are never added by the readers
};

}  // namespace figurine::body
