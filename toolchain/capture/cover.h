// Which parts of one mesh another garment covers in the rest pose: socks under trousers, skin under
// a shirt. What is covered is not drawn, so that it cannot poke through where two fitted surfaces
// lie within millimetres of each other.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/capture/mesh.h"

namespace figurine::capture {

struct CoverReach {
  float outward_m = 0.04f;  // how far above a vertex the garment may lie and still cover it
  float inward_m = 0.015f;  // how far below it: the vertex already pokes through
};

// [V] 1: the garment crosses the vertex' normal within reach.
std::vector<uint8_t> covered_vertices(const Mesh& mesh, const Mesh& garment,
                                      const CoverReach& reach = {});

// Removes the triangles whose corners are all marked. Vertices stay.
void remove_triangles(Mesh& mesh, const std::vector<uint8_t>& marked);

}  // namespace figurine::capture
