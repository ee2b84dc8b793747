// Turns a surface with UV charts into the texels of a body package at any resolution T
// (formats/include/figurine/body.h).
//
// A texel is covered if its centre lies in a triangle of the UV map that is not hidden; everything
// it holds is interpolated barycentrically there. Texels within two of a covered one are border:
// they repeat the nearest covered texel, so that convolutions at a chart's edge see their own
// chart.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/body.h"
#include "toolchain/body/body_model.h"

namespace figurine::body {

inline constexpr int kBorderTexels = 2;

// Owns the arrays of a figurine::Body.
struct TexelBody {
  std::string name;
  uint32_t uv_size = 0;
  uint32_t shape_count = 0;
  JointPositions joint_m{};
  std::vector<float> joint_shape_basis_m;
  std::vector<uint32_t> texel;
  std::vector<float> position_m, normal, weights, spacing_m, shape_basis_m;
  std::vector<uint8_t> joints;
  std::vector<uint32_t> border_texel, border_source;

  // How the texels came about: for tests, reports and the capture tool. A package holds it if the
  // layout is not the mesh's own (states_mesh_places).
  std::vector<uint32_t> triangle;  // [N] the surface's triangle under each texel
  std::vector<float> barycentric;  // [N,3] weights of its three corners
  bool states_mesh_places = false;
  double largest_lost_weight = 0;  // share of skin weight beyond K influences, at worst
  uint32_t most_influences = 0;    // joints that a texel hangs on before the cut to K, at most

  figurine::Body view() const;  // borrows from this
};

// uv_size: 8 to kMaxUvSize. Degenerate UV triangles cover nothing. Where triangles overlap in the
// UV map, the first in the list wins. InputError if a triangle's UV leaves [0,1], or if nothing is
// covered.
TexelBody make_texel_body(const BodyModel& model, uint32_t uv_size);

}  // namespace figurine::body
