// A network's head to world-space Gaussians, a texel at a time: the specification of every other
// kernel.
//
// Canonical first: position = texel + offset, factor = R S. Then the world: the centre by the
// blended transform, the factor by its linear part A itself (no rotation is extracted from it).
// Based on: docs/numerics.md, "From the head to a Gaussian"; Loper et al., SMPL, 2015 (skinning).
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

float clamp(float value, float low, float high) {
  return value < low ? low : (value > high ? high : value);
}

// The unit quaternion's rotation matrix, row-major; zero or not finite quaternions give the
// identity. As figurine::rotation_from_quaternion (pose.h).
void rotation_from_quaternion(const float* wxyz, float* rotation) {
  for (int i = 0; i < 9; ++i) rotation[i] = i % 4 == 0 ? 1.0f : 0.0f;
  // Scaled by the largest component first, so that lengths from 1e-18 to 1e18 neither overflow nor
  // vanish.
  float largest = 0;
  for (int k = 0; k < 4; ++k) {
    if (!is_finite(wxyz[k])) return;
    const float magnitude = __builtin_fabsf(wxyz[k]);
    largest = magnitude > largest ? magnitude : largest;
  }
  if (largest < 1e-18f) return;
  const float a = wxyz[0] / largest, b = wxyz[1] / largest, c = wxyz[2] / largest,
              d = wxyz[3] / largest;
  const float inverse = 1.0f / __builtin_sqrtf(a * a + b * b + c * c + d * d);
  const float w = a * inverse, x = b * inverse, y = c * inverse, z = d * inverse;
  rotation[0] = 1 - 2 * (y * y + z * z);
  rotation[1] = 2 * (x * y - w * z);
  rotation[2] = 2 * (x * z + w * y);
  rotation[3] = 2 * (x * y + w * z);
  rotation[4] = 1 - 2 * (x * x + z * z);
  rotation[5] = 2 * (y * z - w * x);
  rotation[6] = 2 * (x * z - w * y);
  rotation[7] = 2 * (y * z + w * x);
  rotation[8] = 1 - 2 * (x * x + y * y);
}

}  // namespace

void decode_skin_baseline(const DecodeSkinJob& job) {
  GaussianBlock& out = *job.gaussians;
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const float* h = job.head[lane];
    float x[3], scale[3], rotation[9], factor[9];
    for (int k = 0; k < 3; ++k) {
      const float offset = job.offset_scale_m * clamp(h[k], -job.max_offset, job.max_offset);
      x[k] = job.texels->position_m[k][lane] + offset;
      scale[k] = job.texels->extent_m[lane] *
                 exp_float(clamp(h[3 + k], -job.max_log_scale, job.max_log_scale));
    }
    const float quaternion[4] = {1.0f + h[6], h[7], h[8], h[9]};
    rotation_from_quaternion(quaternion, rotation);
    for (int i = 0; i < 9; ++i) factor[i] = rotation[i] * scale[i % 3];

    float a[9];
    for (int i = 0; i < 9; ++i) a[i] = job.transforms->linear[i][lane];
    for (int i = 0; i < 3; ++i) {
      out.position_m[i][lane] = (a[3 * i] * x[0] + a[3 * i + 1] * x[1]) +
                                (a[3 * i + 2] * x[2] + job.transforms->own_translation_m[i][lane]);
      for (int j = 0; j < 3; ++j) {
        out.factor[3 * i + j][lane] =
            a[3 * i] * factor[j] + a[3 * i + 1] * factor[3 + j] + a[3 * i + 2] * factor[6 + j];
      }
    }
    out.opacity[lane] = logistic(h[10] + job.opacity_bias);
    for (uint32_t k = 0; k < job.sh_values; ++k) out.sh[k][lane] = h[11 + k];
  }
}

}  // namespace figurine::kernels
