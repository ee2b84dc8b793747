#include "toolchain/capture/cloth_strength.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <queue>

#include "figurine/pose.h"
#include "toolchain/body/skeleton.h"

namespace figurine::capture {
namespace {

// [V] which connected part a vertex belongs to, named by its lowest vertex.
std::vector<uint32_t> connected_parts(const Mesh& mesh) {
  std::vector<uint32_t> parent(mesh.vertex_count());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const uint32_t a = root(mesh.triangles[t]), b = root(mesh.triangles[t / 3 * 3]);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (uint32_t v = 0; v < parent.size(); ++v) parent[v] = root(v);
  return parent;
}

// [V] length of the shortest way along edges to an open border, at most `limit_m`.
std::vector<float> border_distance(const Mesh& mesh, float limit_m) {
  std::map<std::array<uint32_t, 2>, int> faces_of;
  for (size_t t = 0; t < mesh.triangles.size(); t += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(mesh.triangles[t + k], mesh.triangles[t + (k + 1) % 3]);
      ++faces_of[{low, high}];
    }
  }
  std::vector<float> distance(mesh.vertex_count(), limit_m);
  std::vector<std::vector<std::pair<uint32_t, float>>> neighbours(mesh.vertex_count());
  using Entry = std::pair<float, uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const auto& [edge, count] : faces_of) {
    const float size = length(load(&mesh.position_m[size_t{edge[0]} * 3]) -
                              load(&mesh.position_m[size_t{edge[1]} * 3]));
    for (int k = 0; k < 2; ++k) {
      neighbours[edge[k]].push_back({edge[1 - k], size});
      if (count == 1) distance[edge[k]] = 0, queue.push({0.0f, edge[k]});
    }
  }
  while (!queue.empty()) {
    const auto [way, v] = queue.top();
    queue.pop();
    if (way > distance[v]) continue;
    for (const auto& [to, size] : neighbours[v]) {
      if (way + size < distance[to]) distance[to] = way + size, queue.push({way + size, to});
    }
  }
  return distance;
}

// Whether cloth does not lie on the parts of the body that follow this joint.
bool is_bare(uint8_t joint) {
  return joint == body::kHead || joint == body::kNeck || joint == body::kJaw ||
         joint == body::kLeftEye || joint == body::kRightEye || joint == body::kLeftAnkle ||
         joint == body::kRightAnkle || joint == body::kLeftFoot || joint == body::kRightFoot ||
         joint == body::kLeftWrist || joint == body::kRightWrist || joint > body::kRightEye;
}

}  // namespace

std::vector<float> cloth_strength(const Mesh& mesh, float fade_m) {
  constexpr float kSmallestPart_m = 0.25f;  // diagonal of its box
  const std::vector<uint32_t> part = connected_parts(mesh);
  std::vector<std::array<Vec3, 2>> box(mesh.vertex_count(),
                                       {Vec3{1e9f, 1e9f, 1e9f}, Vec3{-1e9f, -1e9f, -1e9f}});
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    const Vec3 p = load(&mesh.position_m[size_t{v} * 3]);
    auto& [low, high] = box[part[v]];
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  std::vector<float> strength = border_distance(mesh, fade_m);
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    const float near = strength[v] / fade_m;
    float bare = 0;
    for (uint32_t k = 0; k < kSkinInfluences; ++k) {
      const size_t i = size_t{v} * kSkinInfluences + k;
      if (is_bare(mesh.skin_joints[i])) bare += mesh.skin_weights[i];
    }
    const auto& [low, high] = box[part[v]];
    const bool small = length(high - low) < kSmallestPart_m;
    strength[v] = small ? 0 : near * near * (3 - 2 * near) * std::max(0.0f, 1 - bare);
  }
  return strength;
}

}  // namespace figurine::capture
