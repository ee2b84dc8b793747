#include "toolchain/model/head.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "figurine/check.h"
#include "toolchain/model/parallel.h"

namespace figurine::model {

namespace {

constexpr uint32_t kChunk = 256;  // texels per task

// sum_k w_k B_k, row-major [3,4]; the operations of figurine::blend in their order.
template <class Scalar>
void blend_transforms(const HeadFrame& frame, uint32_t texel, Scalar* m) {
  const uint8_t* joints = &frame.body->texel_joints[size_t(texel) * kSkinInfluences];
  const float* weights = &frame.body->texel_weights[size_t(texel) * kSkinInfluences];
  for (int i = 0; i < 12; ++i) m[i] = 0;
  for (uint32_t k = 0; k < kSkinInfluences; ++k) {
    if (weights[k] == 0) continue;
    const std::array<float, 12>& b = frame.world_from_rest[joints[k]].m;
    for (int i = 0; i < 12; ++i) m[i] += Scalar(weights[k]) * Scalar(b[i]);
  }
}

// What decoding computes on the way to F = A R S.
template <class Scalar>
struct Decoded {
  Scalar blended[12];
  Scalar quaternion[4];   // unit
  Scalar inverse_length;  // of the unnormalised quaternion; 0 if it was not usable
  Scalar rotated[9];      // A R
  Scalar scale[3];        // widened to the smallest extent s: sqrt(own^2 + s^2)
  Scalar share[3];        // own / scale
  Scalar kept;            // of the opacity: the product of the shares
  bool scale_clamped[3];
};

// The unit quaternion of (1,0,0,0) + h; the identity where figurine::rotation_from_quaternion gives
// it.
template <class Scalar>
void unit_quaternion(const Scalar* h, Scalar* unit, Scalar& inverse_length) {
  const Scalar raw[4] = {1 + h[0], h[1], h[2], h[3]};
  Scalar largest = 0;
  bool finite = true;
  for (int k = 0; k < 4; ++k) {
    finite = finite && std::isfinite(raw[k]);
    largest = std::fmax(largest, std::fabs(raw[k]));
  }
  if (!finite || largest < Scalar(1e-18f)) {
    unit[0] = 1, unit[1] = unit[2] = unit[3] = 0;
    inverse_length = 0;
    return;
  }
  Scalar scaled[4];
  for (int k = 0; k < 4; ++k) scaled[k] = raw[k] / largest;
  const Scalar inverse = 1 / std::sqrt(scaled[0] * scaled[0] + scaled[1] * scaled[1] +
                                       scaled[2] * scaled[2] + scaled[3] * scaled[3]);
  for (int k = 0; k < 4; ++k) unit[k] = scaled[k] * inverse;
  inverse_length = inverse / largest;
}

template <class Scalar>
void rotation_matrix(const Scalar* q, Scalar* r) {
  const Scalar w = q[0], x = q[1], y = q[2], z = q[3];
  r[0] = 1 - 2 * (y * y + z * z), r[1] = 2 * (x * y - w * z), r[2] = 2 * (x * z + w * y);
  r[3] = 2 * (x * y + w * z), r[4] = 1 - 2 * (x * x + z * z), r[5] = 2 * (y * z - w * x);
  r[6] = 2 * (x * z - w * y), r[7] = 2 * (y * z + w * x), r[8] = 1 - 2 * (x * x + y * y);
}

// dL/dR [3,3] to dL/dq of the unit quaternion, components taken as independent.
template <class Scalar>
void rotation_matrix_backward(const Scalar* q, const Scalar* d, Scalar* dq) {
  const Scalar w = q[0], x = q[1], y = q[2], z = q[3];
  dq[0] = 2 * (x * (d[7] - d[5]) + y * (d[2] - d[6]) + z * (d[3] - d[1]));
  dq[1] = 2 * (w * (d[7] - d[5]) + y * (d[1] + d[3]) + z * (d[2] + d[6]) - 2 * x * (d[4] + d[8]));
  dq[2] = 2 * (w * (d[2] - d[6]) + x * (d[1] + d[3]) + z * (d[5] + d[7]) - 2 * y * (d[0] + d[8]));
  dq[3] = 2 * (w * (d[3] - d[1]) + x * (d[2] + d[6]) + y * (d[5] + d[7]) - 2 * z * (d[0] + d[4]));
}

template <class Scalar>
void decode_texel(const HeadFrame& frame, uint32_t texel, const Scalar* h, Decoded<Scalar>& out) {
  blend_transforms(frame, texel, out.blended);
  unit_quaternion(h + 6, out.quaternion, out.inverse_length);
  Scalar rotation[9];
  rotation_matrix(out.quaternion, rotation);
  const Scalar limit = Scalar(frame.decoding.max_log_scale);
  const Scalar base =
      Scalar(frame.decoding.spacing_scale) * Scalar(frame.body->texel_spacing_m[texel]);
  for (int j = 0; j < 3; ++j) {
    const Scalar log_scale = h[3 + j];
    out.scale_clamped[j] = !(log_scale >= -limit && log_scale <= limit);
    out.scale[j] = base * std::exp(log_scale < -limit  ? -limit
                                   : log_scale > limit ? limit
                                                       : log_scale);
    for (int i = 0; i < 3; ++i) {
      const Scalar* row = &out.blended[4 * i];
      out.rotated[3 * i + j] =
          row[0] * rotation[j] + row[1] * rotation[3 + j] + row[2] * rotation[6 + j];
    }
    out.share[j] = 1;
  }
  out.kept = 1;
  if (frame.smallest_extent_m.empty() || frame.smallest_extent_m[texel] == 0) return;
  const Scalar s = Scalar(frame.smallest_extent_m[texel]);
  for (int j = 0; j < 3; ++j) {
    const Scalar own = out.scale[j];
    out.scale[j] = std::sqrt(own * own + s * s);
    out.share[j] = own / out.scale[j];
  }
  out.kept = out.share[0] * out.share[1] * out.share[2];
}

// opacity share_0 share_1 share_2 in the device's order.
template <class Scalar>
Scalar widened_opacity(Scalar opacity, const Decoded<Scalar>& decoded) {
  for (const Scalar share : decoded.share) opacity *= share;
  return opacity;
}

// The offset output within its bound, if it has one.
template <class Scalar>
Scalar bounded_offset(const HeadDecoding& decoding, Scalar h) {
  const Scalar limit = Scalar(decoding.max_offset);
  return limit == 0 ? h : (h < -limit ? -limit : (h > limit ? limit : h));
}

template <class Scalar>
Scalar sigmoid(Scalar x) {
  return 1 / (1 + std::exp(-x));
}

void check(const HeadFrame& frame) {
  FIG_CHECK(
      frame.body != nullptr && frame.texel_position_m.size() == frame.body->texel_position_m.size(),
      "one canonical position per texel");
  FIG_CHECK(frame.world_from_rest.size() == frame.body->joint_count(),
            "one skinning transform per joint");
  FIG_CHECK(frame.smallest_extent_m.empty() ||
                frame.smallest_extent_m.size() == frame.body->texel_count(),
            "one smallest extent per texel");
  FIG_CHECK(frame.decoding.sh_degree <= kMaxShDegree, "SH degree");
}

}  // namespace

template <class Scalar>
void GaussianBuffer<Scalar>::resize(uint32_t gaussians, uint32_t degree) {
  count = gaussians;
  sh_degree = degree;
  position_m.resize(size_t(gaussians) * 3);
  covariance_factor.resize(size_t(gaussians) * 9);
  opacity.resize(gaussians);
  sh.resize(size_t(gaussians) * 3 * sh_coefficients(degree));
}

template <class Scalar>
void decode_head(const HeadFrame& frame, const Scalar* head, uint32_t threads,
                 GaussianBuffer<Scalar>& gaussians) {
  check(frame);
  const uint32_t count = frame.body->texel_count(),
                 channels = head_channels(frame.decoding.sh_degree), sh_values = channels - 11;
  gaussians.resize(count, frame.decoding.sh_degree);
  parallel_for(threads, (count + kChunk - 1) / kChunk, [&](uint32_t chunk) {
    for (uint32_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      const Scalar* h = head + size_t(i) * channels;
      Decoded<Scalar> decoded;
      decode_texel(frame, i, h, decoded);
      Scalar canonical[3];
      for (int k = 0; k < 3; ++k)
        canonical[k] = Scalar(frame.texel_position_m[3 * size_t(i) + k]) +
                       Scalar(frame.decoding.offset_scale_m) * bounded_offset(frame.decoding, h[k]);
      for (int r = 0; r < 3; ++r) {
        const Scalar* row = &decoded.blended[4 * r];
        gaussians.position_m[3 * size_t(i) + r] =
            (row[0] * canonical[0] + row[1] * canonical[1]) + (row[2] * canonical[2] + row[3]);
        for (int j = 0; j < 3; ++j)
          gaussians.covariance_factor[9 * size_t(i) + 3 * r + j] =
              decoded.rotated[3 * r + j] * decoded.scale[j];
      }
      gaussians.opacity[i] =
          widened_opacity(sigmoid(h[10] + Scalar(frame.decoding.opacity_bias)), decoded);
      std::copy_n(h + 11, sh_values, &gaussians.sh[size_t(i) * sh_values]);
    }
  });
}

template <class Scalar>
void decode_head_backward(const HeadFrame& frame, const Scalar* head,
                          const GaussianBuffer<Scalar>& gradients, uint32_t threads,
                          Scalar* head_gradient) {
  check(frame);
  const uint32_t count = frame.body->texel_count(),
                 channels = head_channels(frame.decoding.sh_degree), sh_values = channels - 11;
  FIG_CHECK(gradients.count == count && gradients.sh_degree == frame.decoding.sh_degree,
            "gradients of these Gaussians");
  std::fill_n(head_gradient, size_t(count) * channels, Scalar(0));
  parallel_for(threads, (count + kChunk - 1) / kChunk, [&](uint32_t chunk) {
    for (uint32_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      const Scalar* const dp = &gradients.position_m[3 * size_t(i)];
      const Scalar* const df = &gradients.covariance_factor[9 * size_t(i)];
      const Scalar* const dsh = &gradients.sh[size_t(i) * sh_values];
      // Most Gaussians of a view are hidden: their gradients are exactly zero, and so are the
      // outputs' (also where an output is not finite).
      const auto zero = [](const Scalar* values, size_t n) {
        return std::all_of(values, values + n, [](Scalar v) { return v == 0; });
      };
      if (zero(dp, 3) && zero(df, 9) && gradients.opacity[i] == 0 && zero(dsh, sh_values)) continue;
      const Scalar* h = head + size_t(i) * channels;
      Scalar* const dh = head_gradient + size_t(i) * channels;
      Decoded<Scalar> at;
      decode_texel(frame, i, h, at);
      const Scalar* m = at.blended;
      // p = A (x + offset_scale h) + t
      for (int k = 0; k < 3; ++k) {
        const bool moves =
            frame.decoding.max_offset == 0 || std::abs(h[k]) <= Scalar(frame.decoding.max_offset);
        dh[k] = moves ? Scalar(frame.decoding.offset_scale_m) *
                            (m[k] * dp[0] + m[4 + k] * dp[1] + m[8 + k] * dp[2])
                      : Scalar(0);
      }
      const Scalar opacity = sigmoid(h[10] + Scalar(frame.decoding.opacity_bias));
      const Scalar d_opacity = gradients.opacity[i] * at.kept;
      // F = (A R) S: dS_j = sum_i dF_ij (AR)_ij; dR = A^T dF S. Of the own scale's logarithm,
      // d ln S_j = share_j^2 and d ln kept = 1 - share_j^2.
      Scalar d_rotation[9];
      for (int j = 0; j < 3; ++j) {
        const Scalar d_scale =
            df[j] * at.rotated[j] + df[3 + j] * at.rotated[3 + j] + df[6 + j] * at.rotated[6 + j];
        const Scalar squared = at.share[j] * at.share[j];
        dh[3 + j] = at.scale_clamped[j]
                        ? Scalar(0)
                        : d_scale * at.scale[j] * squared + d_opacity * opacity * (1 - squared);
        for (int k = 0; k < 3; ++k)
          d_rotation[3 * k + j] =
              at.scale[j] * (m[k] * df[j] + m[4 + k] * df[3 + j] + m[8 + k] * df[6 + j]);
      }
      // q = raw / |raw|: only the part across q turns it.
      Scalar d_unit[4];
      rotation_matrix_backward(at.quaternion, d_rotation, d_unit);
      Scalar along = 0;
      for (int k = 0; k < 4; ++k) along += d_unit[k] * at.quaternion[k];
      for (int k = 0; k < 4; ++k)
        dh[6 + k] = at.inverse_length * (d_unit[k] - along * at.quaternion[k]);
      dh[10] = d_opacity * opacity * (1 - opacity);
      std::copy_n(dsh, sh_values, dh + 11);
    }
  });
}

template struct GaussianBuffer<float>;
template struct GaussianBuffer<double>;
template void decode_head(const HeadFrame&, const float*, uint32_t, GaussianBuffer<float>&);
template void decode_head(const HeadFrame&, const double*, uint32_t, GaussianBuffer<double>&);
template void decode_head_backward(const HeadFrame&, const float*, const GaussianBuffer<float>&,
                                   uint32_t, float*);
template void decode_head_backward(const HeadFrame&, const double*, const GaussianBuffer<double>&,
                                   uint32_t, double*);

}  // namespace figurine::model
