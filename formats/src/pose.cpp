#include "figurine/pose.h"

#include <cmath>

namespace figurine {

namespace {

std::array<float, 9> multiply(const std::array<float, 9>& a, const std::array<float, 9>& b) {
  std::array<float, 9> product;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j)
      product[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  }
  return product;
}

std::array<float, 3> multiply(const std::array<float, 9>& a, const std::array<float, 3>& x) {
  return {a[0] * x[0] + a[1] * x[1] + a[2] * x[2], a[3] * x[0] + a[4] * x[1] + a[5] * x[2],
          a[6] * x[0] + a[7] * x[1] + a[8] * x[2]};
}

}  // namespace

Status validate_pose(const PoseView& pose, uint32_t joint_count) {
  if (pose.rotations.size() != size_t(joint_count) * 4) {
    return Status(StatusCode::kInvalidArgument,
                  "pose: has " + std::to_string(pose.rotations.size() / 4) +
                      " rotations, the skeleton has " + std::to_string(joint_count) + " joints");
  }
  for (float value : pose.root_translation_m) {
    if (!std::isfinite(value))
      return Status(StatusCode::kInvalidArgument, "pose: the root translation is not finite");
  }
  for (uint32_t j = 0; j < joint_count; ++j) {
    double length2 = 0;
    for (uint32_t k = 0; k < 4; ++k)
      length2 += double(pose.rotations[4 * j + k]) * pose.rotations[4 * j + k];
    if (!(length2 >= 1e-12) || !(length2 < 1e30)) {
      return Status(StatusCode::kInvalidArgument,
                    "pose: the rotation of joint " + std::to_string(j) + " is zero or not finite");
    }
  }
  return {};
}

std::array<float, 9> rotation_from_quaternion(const float* wxyz) {
  // Scaled by the largest component first, so that lengths from 1e-18 to 1e18 neither overflow nor
  // vanish.
  float largest = 0;
  for (int k = 0; k < 4; ++k) {
    if (!std::isfinite(wxyz[k])) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
    largest = std::fmax(largest, std::fabs(wxyz[k]));
  }
  if (largest < 1e-18f) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const float a = wxyz[0] / largest, b = wxyz[1] / largest, c = wxyz[2] / largest,
              d = wxyz[3] / largest;
  const float inverse = 1.0f / std::sqrt(a * a + b * b + c * c + d * d);
  const float w = a * inverse, x = b * inverse, y = c * inverse, z = d * inverse;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),  //
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

std::array<float, 3> root_position(const SkeletonView& skeleton, const PoseView& pose) {
  std::array<float, 3> position;
  for (size_t k = 0; k < 3; ++k)
    position[k] = skeleton.rest_position_m[k] + pose.root_translation_m[k];
  return position;
}

void skinning_transforms(const SkeletonView& skeleton, const PoseView& pose,
                         std::span<Affine> world_from_rest) {
  FIG_CHECK(world_from_rest.size() == skeleton.parents.size(), "one transform per joint");
  // First pass: world_from_joint (R_j, p_j) in place. Parents precede children.
  for (size_t j = 0; j < skeleton.parents.size(); ++j) {
    const std::array<float, 9> local = rotation_from_quaternion(&pose.rotations[4 * j]);
    std::array<float, 9> rotation = local;
    std::array<float, 3> position;
    if (skeleton.parents[j] < 0) {
      position = root_position(skeleton, pose);
    } else {
      const size_t parent = static_cast<size_t>(skeleton.parents[j]);
      const std::array<float, 12>& p = world_from_rest[parent].m;
      const std::array<float, 9> parent_rotation{p[0], p[1], p[2], p[4], p[5],
                                                 p[6], p[8], p[9], p[10]};
      std::array<float, 3> bone;
      for (size_t k = 0; k < 3; ++k)
        bone[k] = skeleton.rest_position_m[3 * j + k] - skeleton.rest_position_m[3 * parent + k];
      rotation = multiply(parent_rotation, local);
      position = multiply(parent_rotation, bone);
      for (size_t k = 0; k < 3; ++k) position[k] = p[4 * k + 3] + position[k];
    }
    for (size_t i = 0; i < 3; ++i) {
      for (size_t k = 0; k < 3; ++k) world_from_rest[j].m[4 * i + k] = rotation[3 * i + k];
      world_from_rest[j].m[4 * i + 3] = position[i];
    }
  }
  // Second pass: B_j x = R_j (x - r_j) + p_j. Not before: children need p_j.
  for (size_t j = 0; j < skeleton.parents.size(); ++j) {
    std::array<float, 12>& m = world_from_rest[j].m;
    const float* rest = &skeleton.rest_position_m[3 * j];
    for (size_t i = 0; i < 3; ++i)
      m[4 * i + 3] -= m[4 * i] * rest[0] + m[4 * i + 1] * rest[1] + m[4 * i + 2] * rest[2];
  }
}

Affine blend(std::span<const Affine> world_from_rest, const uint8_t* joints, const float* weights) {
  Affine sum;
  sum.m.fill(0);
  for (uint32_t k = 0; k < kSkinInfluences; ++k) {
    if (weights[k] == 0) continue;
    const std::array<float, 12>& m = world_from_rest[joints[k]].m;
    for (size_t i = 0; i < 12; ++i) sum.m[i] += weights[k] * m[i];
  }
  return sum;
}

std::array<float, 3> transform_point(const Affine& transform, const float* point) {
  std::array<float, 3> result;
  for (size_t i = 0; i < 3; ++i) {
    const float* row = &transform.m[4 * i];
    result[i] = (row[0] * point[0] + row[1] * point[1]) + (row[2] * point[2] + row[3]);
  }
  return result;
}

std::array<float, 3> transform_normal(const Affine& transform, const float* normal) {
  const std::array<float, 12>& a = transform.m;
  // The cofactor matrix equals det(A) A^-T; its sign is put right so that a mirrored blend does not
  // flip the normal.
  const float cofactor[9] = {
      a[5] * a[10] - a[6] * a[9], a[6] * a[8] - a[4] * a[10], a[4] * a[9] - a[5] * a[8],
      a[2] * a[9] - a[1] * a[10], a[0] * a[10] - a[2] * a[8], a[1] * a[8] - a[0] * a[9],
      a[1] * a[6] - a[2] * a[5],  a[2] * a[4] - a[0] * a[6],  a[0] * a[5] - a[1] * a[4]};
  const float determinant = a[0] * cofactor[0] + a[1] * cofactor[1] + a[2] * cofactor[2];
  const float sign = determinant < 0 ? -1.0f : 1.0f;
  std::array<float, 3> result;
  float length2 = 0;
  for (size_t i = 0; i < 3; ++i) {
    result[i] = sign * (cofactor[3 * i] * normal[0] + cofactor[3 * i + 1] * normal[1] +
                        cofactor[3 * i + 2] * normal[2]);
    length2 += result[i] * result[i];
  }
  if (!(length2 > 1e-24f)) return {0, 0, 0};
  const float inverse = 1.0f / std::sqrt(length2);
  for (float& value : result) value *= inverse;
  return result;
}

}  // namespace figurine
