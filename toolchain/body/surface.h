// A skinned triangle surface in its rest pose: what texels are rasterised from and what the capture
// tool renders.
//
// Metres, y up, the figure faces +z with its feet near y = 0. Letters: V vertices, F triangles, U
// texture coordinates.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "figurine/pose.h"
#include "toolchain/body/skeleton.h"

namespace figurine::body {

struct Surface {
  std::vector<float> position_m;    // [V,3]
  std::vector<uint32_t> triangles;  // [F,3] vertices, counter-clockwise seen from outside
  std::vector<float> uv;  // [U,2] in [0,1], u right, v DOWN: texture row = v * height, as texels
                          // have it (OBJ's v is already flipped)
  std::vector<uint32_t>
      uv_triangles;  // [F,3] indices into uv, corner by corner; a vertex on a seam has several
  std::vector<uint8_t> skin_joints;  // [V,K] K = kSkinInfluences; heaviest first, unused entries
                                     // are joint 0 with weight 0
  std::vector<float> skin_weights;   // [V,K] >= 0, sum 1
  std::vector<uint8_t>
      hidden;  // [F] 1: inside the mouth or an eye socket: drawn in captures, but no texels

  uint32_t vertex_count() const { return static_cast<uint32_t>(position_m.size() / 3); }
  uint32_t triangle_count() const { return static_cast<uint32_t>(triangles.size() / 3); }
};

using JointPositions = std::array<float, 3 * kJointCount>;  // [55,3] metres

// Unit vertex normals: triangle normals weighted by area. position_m [V,3], triangles [F,3] ->
// [V,3]. A vertex of no triangle gets (0,0,1).
std::vector<float> vertex_normals(std::span<const float> position_m,
                                  std::span<const uint32_t> triangles);

// Linear blend skinning of points in the rest pose (equation in figurine/pose.h). position_m [V,3],
// joints and weights [V,K] -> [V,3] world.
std::vector<float> skin_positions(std::span<const float> position_m,
                                  std::span<const uint8_t> joints, std::span<const float> weights,
                                  std::span<const Affine> world_from_rest);

}  // namespace figurine::body
