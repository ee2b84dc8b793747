// A body as the toolchain knows it: a skinned surface, 55 joints and a linear shape space. Made by
// makehuman, smplx or mannequin; texels come from it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "toolchain/body/surface.h"

namespace figurine::body {

struct BodyModel {
  std::string name;
  Surface surface;                          // the mean template: shape coefficients 0
  JointPositions joint_m{};                 // of the mean template
  uint32_t shape_count = 0;                 // S
  std::vector<float> vertex_shape_basis_m;  // [S,V,3] metres per unit; one unit is one standard
                                            // deviation where the shape space is statistical
  std::vector<float> joint_shape_basis_m;   // [S,55,3]
  Provenance
      provenance;  // sources and licence of the data; tool and settings are the command's to fill

  SkeletonView skeleton() const { return {joint_parents(), joint_m}; }
};

// The mean template's vertices [V,3] and joints moved by shape coefficients (missing ones are
// zero).
std::vector<float> shaped_vertices(const BodyModel& model, std::span<const float> shape);
JointPositions shaped_joints(const BodyModel& model, std::span<const float> shape);

// The shape coefficients [S] whose vertices are nearest to the given ones [V,3] in the
// least-squares sense. Translation is not fitted: both must stand alike.
std::vector<float> project_shape(const BodyModel& model, std::span<const float> vertices_m);

}  // namespace figurine::body
