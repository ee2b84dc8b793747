// A network's head to world-space Gaussians: the specification of every other kernel. A loop over
// the lanes a step, without branches, so that compilers make vector code of each.
//
// A coarser network's heads come together first, lane by lane, because a head's values lie side by
// side; then the static part, in planes. Canonical first: position = texel + offset, factor = R S.
// Then the world: the centre by the blended transform, the factor by its linear part A itself (no
// rotation is extracted from it). Based on: docs/numerics.md, "From the head to a Gaussian"; Loper
// et al., SMPL, 2015 (skinning).
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

using Plane = float[kLanes];
using Head = float[kShapeValues + kMaxShValues];

float clamp(float value, float low, float high) {
  return value < low ? low : (value > high ? high : value);
}

// The heads of texels between a coarser network's.
void blend_heads(const DecodeSkinJob& job, Head* __restrict blended) {
  const uint32_t values = kShapeValues + job.sh_values;
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const float *y0 = job.head[0][lane], *y1 = job.head[1][lane], *y2 = job.head[2][lane],
                *y3 = job.head[3][lane];
    const float w0 = job.taps->weight[0][lane], w1 = job.taps->weight[1][lane],
                w2 = job.taps->weight[2][lane], w3 = job.taps->weight[3][lane];
    float* __restrict out = blended[lane];
    for (uint32_t k = 0; k < values; ++k)
      out[k] = (w0 * y0[k] + w1 * y1[k]) + (w2 * y2[k] + w3 * y3[k]);
  }
}

void load_heads(const float* const* heads, uint32_t sh_values, Plane* __restrict head,
                Plane* __restrict sh) {
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const float* h = heads[lane];
    for (uint32_t k = 0; k < kShapeValues; ++k) head[k][lane] = h[k];
    for (uint32_t k = 0; k < sh_values; ++k) sh[k][lane] = h[kShapeValues + k];
  }
}

void add_static(const StaticBlock& __restrict texels, uint32_t sh_values, Plane* __restrict head,
                Plane* __restrict sh) {
  for (uint32_t k = 0; k < kShapeValues; ++k) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) head[k][lane] += texels.sum[k][lane];
  }
  for (uint32_t c = 0; c < 3; ++c) {
    for (uint32_t lane = 0; lane < kLanes; ++lane)
      sh[c][lane] = (sh[c][lane] + kHalfColour) * texels.gain[c][lane] - kHalfColour;
  }
  for (uint32_t k = 3; k < sh_values; ++k) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) sh[k][lane] *= texels.gain[k % 3][lane];
  }
}

void compose_heads(const DecodeSkinJob& job, Plane* __restrict head, Plane* __restrict sh) {
  if (job.taps == nullptr) {
    load_heads(job.head[0], job.sh_values, head, sh);
  } else {
    Head blended[kLanes];
    blend_heads(job, blended);
    const float* heads[kLanes];
    for (uint32_t lane = 0; lane < kLanes; ++lane) heads[lane] = blended[lane];
    load_heads(heads, job.sh_values, head, sh);
  }
  if (job.static_part != nullptr) add_static(*job.static_part, job.sh_values, head, sh);
}

// Gaussians blurred to their texel's smallest extent, with the weight that they had.
void widen(const ExtentBlock& __restrict smallest, Plane* __restrict scale,
           float* __restrict opacity) {
  for (int k = 0; k < 3; ++k) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      const float own = scale[k][lane], s = smallest.smallest_m[lane];
      const float wide = __builtin_sqrtf(own * own + s * s);
      const float share = own / wide;  // not a number of nothing and nothing: then s is 0
      const bool widens = s > 0;
      opacity[lane] *= widens ? share : 1.0f;
      scale[k][lane] = widens ? wide : own;
    }
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
  compose_heads(job, head, out.sh);
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
  if (job.smallest != nullptr) widen(*job.smallest, scale, out.opacity);
  rotations_from_quaternions(head + 6, rotation);
  skin_positions(*job.transforms, out.position_m);
  skin_factors(*job.transforms, rotation, scale, out.factor);
}

}  // namespace figurine::kernels
