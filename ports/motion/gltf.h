// Reads the animated skeletons of glTF 2.0 files, binary (.glb, .vrm, .vrma) or JSON with its
// buffers inside (.gltf with data URIs): the tree of nodes and the keys of one animation. For
// untrusted input.
//
// Meshes, materials, images and skins are not looked at. Nothing but the file itself is opened: a
// buffer that names another file is an error where an animation needs it. Keys are kept as they are
// in the file and interpolated when asked for, as its author meant them. What is wrong with a node
// or its keys is kept with the node (`defect`): it matters to whoever needs that node.
//
// Based on: Khronos Group, glTF 2.0 Specification, 2021, sections 3.6 (buffers), 3.11 and appendix
// C (animation), 4.4 (GLB); VRM Consortium, VRMC_vrm_animation 1.0, VRMC_vrm 1.0 and VRM 0.0
// (humanBones).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "figurine/status.h"
#include "ports/motion/rotation.h"

namespace figurine::ports {

// A node's transform to its parent: translate * rotate * scale.
struct GltfTransform {
  Vec3 translation{0, 0, 0};
  Quat rotation{1, 0, 0, 0};  // unit
  Vec3 scale{1, 1, 1};
};

struct GltfNode {
  std::string
      name;  // at most 128 characters, control characters replaced; empty where the file has none
  int parent = -1;  // in file order, so it may come later
  GltfTransform rest;
  std::string defect;  // why its transform or its keys cannot be used: field and reason
};

enum class GltfPath : uint8_t { kTranslation, kRotation, kScale };
enum class GltfInterpolation : uint8_t { kStep, kLinear, kCubicSpline };

struct GltfTrack {
  uint32_t node = 0;
  GltfPath path = GltfPath::kTranslation;
  GltfInterpolation interpolation = GltfInterpolation::kLinear;
  std::vector<float> times_s;  // [K] strictly increasing
  std::vector<float> values;   // [K,3] or [K,4] (xyzw); kCubicSpline: [K,3,3] or [K,3,4], tangent
                               // in, value, tangent out
};

struct Gltf {
  std::string where;  // the file, for messages
  std::vector<GltfNode> nodes;
  std::vector<uint32_t> order;                                // all nodes, parents before children
  std::vector<std::pair<std::string, uint32_t>> human_bones;  // VRM's bone names and their nodes
  uint32_t animation = 0;
  std::vector<GltfTrack> tracks;             // of that animation; at most one a node and path
  std::vector<std::vector<uint32_t>> moved;  // nodes that each of the file's animations moves

  // Transforms to the parents at a time; before the first and after the last key of a track its end
  // holds.
  std::vector<GltfTransform> at(double time_s) const;
};

// Limits: 4096 nodes, 2^26 key values, magnitudes to 1e6, times to 1e5 s, 2^21 values of JSON.
// kCorrupt or kUnsupported naming `where`, field and reason.
Result<Gltf> parse_gltf(std::span<const std::byte> bytes, const std::string& where,
                        uint32_t animation = 0);

}  // namespace figurine::ports
