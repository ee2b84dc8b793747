// A procedural body of the project's own: no data, the 55 joints of SMPL-X, smooth lofted parts,
// one rectangular UV chart each. The body of the tests.
//
// What it is not: anatomy. Parts are closed tubes that overlap where limbs meet the trunk, like an
// artist's wooden figure. Rest: arms 45 degrees down.
#pragma once

#include "toolchain/body/body_model.h"

namespace figurine::body {

// In units of one standard deviation of adults: the coefficients of its shape space, in this order.
struct MannequinShape {
  float stature = 0;    // 7 cm of height, everything in proportion
  float girth = 0;      // 10 % of every cross-section
  float legs = 0;       // 3 cm of leg length at unchanged trunk
  float shoulders = 0;  // 1.5 cm of shoulder half-width
};
inline constexpr uint32_t kMannequinShapeCount = 4;

// The mean template is MannequinShape{}; each direction is half the difference between +1 and -1.
// The same bytes on every call.
BodyModel make_mannequin();

// A mannequin of any shape itself, not its linearisation: vertices in the order of
// make_mannequin().surface.
std::vector<float> mannequin_vertices(const MannequinShape& shape);
JointPositions mannequin_joints(const MannequinShape& shape);

}  // namespace figurine::body
