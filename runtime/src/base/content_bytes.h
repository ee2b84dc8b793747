// What an avatar's or a sampler's contents take in containers: an upper bound, for the reserves of
// those who copy it and of those who build on it (figurine/detail/memory_reserve.h).
#pragma once

#include <cstddef>

#include "figurine/avatar.h"
#include "figurine/sampler.h"

namespace figurine {

// Of a network and static part of so many groups: copies, and all lists with an entry for each
// layer, output channel or group that are made while they are sampled or added to a renderer.
inline size_t content_bytes(const Network& network, size_t groups) {
  constexpr size_t kBase = 48 << 10;    // messages, texts, and what there is one of
  constexpr size_t kOfLayer = 2 << 10;  // its struct in several copies, its shapes, its words
  constexpr size_t kOfChannel = 8 * sizeof(float);
  size_t bytes = kBase + kOfLayer * (network.layers.size() + groups);
  for (const Layer& layer : network.layers) bytes += kOfChannel * layer.out_channels;
  return bytes;
}

// What KnownPoses copies and factorises.
inline size_t content_bytes(const PoseStatistics& statistics) {
  if (statistics.distances.empty()) return 0;
  const size_t features = 3 * statistics.joints.size();
  return (features * (features + 3) / 2) * sizeof(double) + statistics.distances.size_bytes() +
         statistics.joints.size();
}

inline size_t content_bytes(const Avatar& avatar) {
  return content_bytes(avatar.network, avatar.static_part.groups.size()) +
         content_bytes(avatar.pose_statistics);
}

inline size_t content_bytes(const Sampler& sampler) {
  constexpr size_t kOfMatrix = 256, kOfNumber = 32;
  size_t numbers =
      sampler.denoiser.d_model + sampler.values.size() + 4 * sampler.golden_seeds.size();
  for (const SampledStaticGroup& group : sampler.static_groups) numbers += group.patch_rows.size();
  return content_bytes(sampler.network, sampler.static_groups.size()) +
         kOfMatrix * (sampler.ranks.size() + 4 * (sampler.denoiser.blocks + 1)) +
         kOfNumber * numbers;
}

}  // namespace figurine
