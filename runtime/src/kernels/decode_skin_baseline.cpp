// A network's head to world-space Gaussians: the specification of every other kernel. A loop over
// the lanes a step, without branches, so that compilers make vector code of each.
//
// Canonical first: position = texel + offset, factor = R S. Then the world: the centre by the
// blended transform, the factor by its linear part A itself (no rotation is extracted from it).
// Based on: docs/numerics.md, "From the head to a Gaussian"; Loper et al., SMPL, 2015 (skinning).
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

constexpr uint32_t kShapeValues = 11;  // of a head: offset 3, log-scale 3, quaternion 4, opacity

using Plane = float[kLanes];

float clamp(float value, float low, float high) {
  return value < low ? low : (value > high ? high : value);
}

void load_heads(const DecodeSkinJob& job, Plane* __restrict head, Plane* __restrict sh) {
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const float* h = job.head[lane];
    for (uint32_t k = 0; k < kShapeValues; ++k) head[k][lane] = h[k];
    for (uint32_t k = 0; k < job.sh_values; ++k) sh[k][lane] = h[kShapeValues + k];
  }
}

// Unit quaternions' rotation matrices, row-major; zero or not finite quaternions give the identity.
// As figurine::rotation_from_quaternion (pose.h).
void rotations_from_quaternions(const Plane* __restrict wxyz, Plane* __restrict rotation) {
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    // Scaled by the largest component first, so that lengths from 1e-18 to 1e18 neither overflow
    // nor vanish.
    bool finite = true;
    float largest = 0;
    for (int k = 0; k < 4; ++k) {
      const float magnitude = __builtin_fabsf(wxyz[k][lane]);
      const bool is_number = is_finite(wxyz[k][lane]);
      finite = finite & is_number;
      largest = magnitude > largest ? magnitude : largest;
    }
    const bool turns = finite & !(largest < 1e-18f);
    largest = turns ? largest : 1;
    const float a = wxyz[0][lane] / largest, b = wxyz[1][lane] / largest,
                c = wxyz[2][lane] / largest, d = wxyz[3][lane] / largest;
    const float inverse = 1.0f / __builtin_sqrtf(a * a + b * b + c * c + d * d);
    const float w = a * inverse, x = b * inverse, y = c * inverse, z = d * inverse;
    rotation[0][lane] = turns ? 1 - 2 * (y * y + z * z) : 1;
    rotation[1][lane] = turns ? 2 * (x * y - w * z) : 0;
    rotation[2][lane] = turns ? 2 * (x * z + w * y) : 0;
    rotation[3][lane] = turns ? 2 * (x * y + w * z) : 0;
    rotation[4][lane] = turns ? 1 - 2 * (x * x + z * z) : 1;
    rotation[5][lane] = turns ? 2 * (y * z - w * x) : 0;
    rotation[6][lane] = turns ? 2 * (x * z - w * y) : 0;
    rotation[7][lane] = turns ? 2 * (y * z + w * x) : 0;
    rotation[8][lane] = turns ? 1 - 2 * (x * x + y * y) : 1;
  }
}

// position: canonical to world in place.
void skin_positions(const TransformBlock& __restrict transforms, Plane* __restrict position) {
  const Plane* a = transforms.linear;
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const float x = position[0][lane], y = position[1][lane], z = position[2][lane];
    for (int i = 0; i < 3; ++i) {
      position[i][lane] = (a[3 * i][lane] * x + a[3 * i + 1][lane] * y) +
                          (a[3 * i + 2][lane] * z + transforms.own_translation_m[i][lane]);
    }
  }
}

void skin_factors(const TransformBlock& __restrict transforms, const Plane* __restrict rotation,
                  const Plane* __restrict scale, Plane* __restrict factor) {
  const Plane* a = transforms.linear;
  for (int j = 0; j < 3; ++j) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      const float f0 = rotation[j][lane] * scale[j][lane],
                  f1 = rotation[3 + j][lane] * scale[j][lane],
                  f2 = rotation[6 + j][lane] * scale[j][lane];
      for (int i = 0; i < 3; ++i) {
        factor[3 * i + j][lane] =
            a[3 * i][lane] * f0 + a[3 * i + 1][lane] * f1 + a[3 * i + 2][lane] * f2;
      }
    }
  }
}

}  // namespace

void decode_skin_baseline(const DecodeSkinJob& job) {
  GaussianBlock& out = *job.gaussians;
  alignas(64) Plane head[kShapeValues], scale[3], rotation[9];
  load_heads(job, head, out.sh);
  for (int k = 0; k < 3; ++k) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      const float offset =
          job.offset_scale_m * clamp(head[k][lane], -job.max_offset, job.max_offset);
      out.position_m[k][lane] = job.texels->position_m[k][lane] + offset;
    }
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      scale[k][lane] = job.texels->extent_m[lane] *
                       exp_float(clamp(head[3 + k][lane], -job.max_log_scale, job.max_log_scale));
    }
  }
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    head[6][lane] = 1.0f + head[6][lane];
    out.opacity[lane] = logistic(head[10][lane] + job.opacity_bias);
  }
  rotations_from_quaternions(head + 6, rotation);
  skin_positions(*job.transforms, out.position_m);
  skin_factors(*job.transforms, rotation, scale, out.factor);
}

}  // namespace figurine::kernels
