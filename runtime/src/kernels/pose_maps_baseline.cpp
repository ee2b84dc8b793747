// What a network sees of a block of texels: the specification of every other kernel. The arithmetic
// is that of figurine::draw_pose_maps (body.h), which the trainer uses.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

// (A^-T n) normalised, by the cofactor matrix; a direction of no length becomes zero.
void transform_normal(const float* a, const float* normal, float* result) {
  // The cofactor matrix equals det(A) A^-T; its sign is put right so that a mirrored blend does not
  // flip the normal.
  const float cofactor[9] = {
      a[4] * a[8] - a[5] * a[7], a[5] * a[6] - a[3] * a[8], a[3] * a[7] - a[4] * a[6],
      a[2] * a[7] - a[1] * a[8], a[0] * a[8] - a[2] * a[6], a[1] * a[6] - a[0] * a[7],
      a[1] * a[5] - a[2] * a[4], a[2] * a[3] - a[0] * a[5], a[0] * a[4] - a[1] * a[3]};
  const float determinant = a[0] * cofactor[0] + a[1] * cofactor[1] + a[2] * cofactor[2];
  const float sign = determinant < 0 ? -1.0f : 1.0f;
  float length2 = 0;
  for (int i = 0; i < 3; ++i) {
    result[i] = sign * (cofactor[3 * i] * normal[0] + cofactor[3 * i + 1] * normal[1] +
                        cofactor[3 * i + 2] * normal[2]);
    length2 += result[i] * result[i];
  }
  const bool has_direction = length2 > 1e-24f;
  const float inverse = has_direction ? 1.0f / __builtin_sqrtf(length2) : 0.0f;
  for (int i = 0; i < 3; ++i) result[i] = has_direction ? result[i] * inverse : 0.0f;
}

}  // namespace

void pose_maps_baseline(const PoseMapsJob& job) {
  const TexelBlock& texels = *job.texels;
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    float a[9], x[3], n[3], normal[3];
    for (int i = 0; i < 9; ++i) a[i] = job.transforms->linear[i][lane];
    for (int i = 0; i < 3; ++i) {
      x[i] = texels.mean_position_m[i][lane];
      n[i] = texels.mean_normal[i][lane];
    }
    transform_normal(a, n, normal);
    for (int i = 0; i < 3; ++i) {
      const float position = (a[3 * i] * x[0] + a[3 * i + 1] * x[1]) +
                             (a[3 * i + 2] * x[2] + job.transforms->mean_translation_m[i][lane]);
      job.maps[i][lane] = ((position - job.root_m[i]) - job.mean[i]) * job.scale[i];
      job.maps[3 + i][lane] = (normal[i] - job.mean[3 + i]) * job.scale[3 + i];
    }
  }
}

}  // namespace figurine::kernels
