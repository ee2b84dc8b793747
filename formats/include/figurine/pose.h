// What a pose is, and the arithmetic from a pose to skinned texels that the trainer and the device
// share (docs/numerics.md, "Pose").
//
// Rest frames of all joints are world-aligned, so a joint's rest transform is a translation to its
// rest position. A pose gives every joint a rotation relative to its parent, and the root a
// translation from its rest position:
//   R_root = Q_root, p_root = r_root + translation;   R_j = R_parent Q_j, p_j = p_parent + R_parent
//       (r_j - r_parent);   B_j x = R_j (x -
//   r_j) + p_j.
// Poses travel as quaternions (wxyz): no libm is needed on the way, and every operation here is
// exactly rounded, so all CPUs agree. Based on: Loper et al., SMPL, 2015, eq. 2-4 (linear blend
// skinning); normals by the inverse transpose of the blended linear part.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "figurine/status.h"

namespace figurine {

inline constexpr uint32_t kMaxJoints = 255;     // joint indices are stored in one byte
inline constexpr uint32_t kSkinInfluences = 8;  // K: joints per texel

// [3,4] row-major: y = A x + t.
struct Affine {
  std::array<float, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

struct PoseView {
  std::array<float, 3> root_translation_m{0, 0, 0};  // of the root joint from its rest position
  std::span<const float> rotations;  // [J,4] quaternions, wxyz, any finite non-zero length
};

// kInvalidArgument, naming the joint, if the count is wrong, a value is not finite, or a quaternion
// is shorter than 1e-6.
Status validate_pose(const PoseView& pose, uint32_t joint_count);

struct SkeletonView {
  std::span<const int16_t> parents;        // [J] parents[0] = -1, parents[j] < j
  std::span<const float> rest_position_m;  // [J,3]
};

// Skinning transforms B_j of every joint. out has J entries. The pose must be valid.
void skinning_transforms(const SkeletonView& skeleton, const PoseView& pose,
                         std::span<Affine> world_from_rest);

// World position of the root joint: rest position + translation.
std::array<float, 3> root_position(const SkeletonView& skeleton, const PoseView& pose);

// sum_k w_k B_k over the K influences of one texel. Influences with weight 0 are not read.
Affine blend(std::span<const Affine> world_from_rest, const uint8_t* joints, const float* weights);

std::array<float, 3> transform_point(const Affine& transform, const float* point);

// (A^-T n) normalised, by the cofactor matrix, so that no inverse of a near-singular A is formed. A
// zero result becomes (0,0,0).
std::array<float, 3> transform_normal(const Affine& transform, const float* normal);

// The unit quaternion's rotation matrix, row-major [3,3]. Zero or not finite quaternions give the
// identity.
std::array<float, 9> rotation_from_quaternion(const float* wxyz);

}  // namespace figurine
