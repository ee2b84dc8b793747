// The Gaussian head: a row of raw outputs per covered texel (compose.h) to a world-space Gaussian,
// and the analytic gradient back (HeadDecoding in figurine/avatar.h).
//
// Instantiated for float (training) and double (finite-difference checks). In float it does the
// same operations in the same order as the runtime's decoding.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/pose.h"
#include "toolchain/model/splatter.h"

namespace figurine::model {

// What one frame's decoding needs beside the head output. Borrowed.
struct HeadFrame {
  const Body* body = nullptr;  // texel, texel_joints, texel_weights, texel_spacing_m are read
  std::span<const float>
      texel_position_m;  // [N,3] canonical: the person's own (shape_body) or body->texel_position_m
  std::span<const Affine> world_from_rest;  // [J] skinning transforms of the same template's joints
  HeadDecoding decoding;
  // [N] metres, SmallestExtents of the texels; empty: none
  std::span<const float> smallest_extent_m = {};
};

// Owned arrays of N Gaussians, reused from frame to frame.
template <class Scalar>
struct GaussianBuffer {
  std::vector<Scalar> position_m, covariance_factor, opacity, sh;
  uint32_t count = 0;
  uint32_t sh_degree = 0;

  void resize(uint32_t gaussians, uint32_t degree);
  GaussianArrays<Scalar> view() const {
    return {count,          sh_degree, position_m.data(), covariance_factor.data(),
            opacity.data(), sh.data()};
  }
  GaussianGradients<Scalar> gradients() {
    return {position_m.data(), covariance_factor.data(), opacity.data(), sh.data()};
  }
};

// head: [N,head_channels(sh_degree)] raw outputs.
template <class Scalar>
void decode_head(const HeadFrame& frame, const Scalar* head, uint32_t threads,
                 GaussianBuffer<Scalar>& gaussians);

// gradients: dL/dGaussians of decode_head's result. head_gradient: [N,channels], all of it is
// written.
template <class Scalar>
void decode_head_backward(const HeadFrame& frame, const Scalar* head,
                          const GaussianBuffer<Scalar>& gradients, uint32_t threads,
                          Scalar* head_gradient);

extern template struct GaussianBuffer<float>;
extern template struct GaussianBuffer<double>;

}  // namespace figurine::model
