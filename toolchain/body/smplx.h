// Imports an SMPL-X model file (.npz, v1.0 or v1.1) that the user has a licence for; nothing of it
// is shipped or cached.
//
// Taken: template, faces, UVs, skin weights, joint regressor, identity shape directions (20 of
// v1.1's 300; the 10 of v1.0, whose other 10 are expressions). Left out: expressions, and the pose
// correctives B_P: they would need a pose-dependent basis per texel, and the network learns the
// residual of plain linear blend skinning anyway. Pickled entries (joint2num, part2num) are never
// read. Based on: Pavlakos et al., Expressive Body Capture: 3D Hands, Face, and Body from a Single
// Image, 2019, equation 1 without B_P and B_E.
#pragma once

#include <string>

#include "toolchain/body/body_model.h"

namespace figurine::body {

// The rest pose is SMPL-X's T-pose, lifted so that the lowest vertex of the template is on y = 0.
// InputError naming file, array and reason.
BodyModel read_smplx(const std::string& path);

}  // namespace figurine::body
