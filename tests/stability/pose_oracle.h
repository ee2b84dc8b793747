// From a pose to the five texels' Gaussians in double, for any pose: the equations of
// docs/numerics.md, no code shared with what it judges.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "tests/golden/posing/five_texels.h"

namespace figurine::stability {

struct Gaussian64 {
  std::array<double, 3> centre_m;
  std::array<double, 9> factor;
};

namespace pose64 {

using Matrix = std::array<double, 9>;
struct Transform {
  Matrix a{};
  std::array<double, 3> t{};
};

inline Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 9; ++i) {
    for (int k = 0; k < 3; ++k) c[i] += a[3 * (i / 3) + k] * b[3 * k + i % 3];
  }
  return c;
}

inline std::array<double, 3> times(const Matrix& a, const double* x) {
  return {a[0] * x[0] + a[1] * x[1] + a[2] * x[2], a[3] * x[0] + a[4] * x[1] + a[5] * x[2],
          a[6] * x[0] + a[7] * x[1] + a[8] * x[2]};
}

inline Matrix rotation(double w, double x, double y, double z) {
  const double s = 2 / (w * w + x * x + y * y + z * z);
  return {1 - s * (y * y + z * z), s * (x * y - w * z),     s * (x * z + w * y),
          s * (x * y + w * z),     1 - s * (x * x + z * z), s * (y * z - w * x),
          s * (x * z - w * y),     s * (y * z + w * x),     1 - s * (x * x + y * y)};
}

inline std::vector<Transform> skinning(const golden::FiveTexels& example, const PoseView& pose,
                                       const std::vector<double>& joints) {
  std::vector<Transform> world(example.parents.size());
  for (size_t j = 0; j < world.size(); ++j) {
    const float* q = &pose.rotations[4 * j];
    world[j].a = rotation(q[0], q[1], q[2], q[3]);
    const int parent = example.parents[j];
    for (int k = 0; k < 3; ++k)
      world[j].t[k] = parent < 0 ? joints[k] + pose.root_translation_m[k] : world[parent].t[k];
    if (parent < 0) continue;
    double bone[3];
    for (int k = 0; k < 3; ++k) bone[k] = joints[3 * j + k] - joints[size_t(3 * parent + k)];
    world[j].a = multiply(world[parent].a, world[j].a);
    const std::array<double, 3> moved = times(world[parent].a, bone);
    for (int k = 0; k < 3; ++k) world[j].t[k] += moved[k];
  }
  for (size_t j = 0; j < world.size(); ++j) {
    const std::array<double, 3> rest = times(world[j].a, &joints[3 * j]);
    for (int k = 0; k < 3; ++k) world[j].t[k] -= rest[k];
  }
  return world;
}

inline Transform blend(const golden::FiveTexels& example, const std::vector<Transform>& world,
                       size_t texel) {
  Transform sum;
  for (size_t k = 0; k < kSkinInfluences; ++k) {
    const double weight = example.weights[texel * kSkinInfluences + k];
    const Transform& one = world[example.texel_joints[texel * kSkinInfluences + k]];
    for (int i = 0; i < 9; ++i) sum.a[i] += weight * one.a[i];
    for (int i = 0; i < 3; ++i) sum.t[i] += weight * one.t[i];
  }
  return sum;
}

inline std::vector<double> shaped(const std::vector<float>& mean, const std::vector<float>& basis,
                                  const std::vector<float>& shape) {
  std::vector<double> out(mean.begin(), mean.end());
  for (size_t s = 0; s < shape.size(); ++s) {
    for (size_t i = 0; i < mean.size(); ++i)
      out[i] += double(shape[s]) * basis[s * mean.size() + i];
  }
  return out;
}

}  // namespace pose64

inline std::vector<Gaussian64> pose_five_texels(const golden::FiveTexels& example,
                                                const PoseView& pose) {
  using namespace pose64;
  const std::vector<double> mean_joints(example.joints.begin(), example.joints.end());
  const std::vector<double> own_joints = shaped(example.joints, example.joint_basis, example.shape);
  const std::vector<double> own_texels = shaped(example.positions, example.basis, example.shape);
  const std::vector<Transform> mean_world = skinning(example, pose, mean_joints),
                               own_world = skinning(example, pose, own_joints);
  const size_t size = example.body.uv_size, inputs = kMapChannels + 4 * example.fourier_octaves,
               outputs = head_channels(0);
  std::vector<Gaussian64> gaussians;
  for (size_t i = 0; i < example.texel.size(); ++i) {
    const Transform mean = blend(example, mean_world, i), own = blend(example, own_world, i);
    const std::vector<double> x(&example.positions[3 * i], &example.positions[3 * i] + 3);
    const double n[3] = {example.normals[3 * i], example.normals[3 * i + 1],
                         example.normals[3 * i + 2]};
    const std::array<double, 3> moved = times(mean.a, x.data());
    // Cofactors in double are exact enough: 1e-16 of the entries, which are at most 1.
    const Matrix& a = mean.a;
    Matrix cofactor;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
        cofactor[3 * r + c] = a[3 * r1 + c1] * a[3 * r2 + c2] - a[3 * r1 + c2] * a[3 * r2 + c1];
      }
    }
    const double determinant = a[0] * cofactor[0] + a[1] * cofactor[1] + a[2] * cofactor[2];
    std::array<double, 3> normal = times(cofactor, n);
    const double length =
        std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) *
        (determinant < 0 ? -1 : 1);
    std::vector<double> in(inputs);
    for (int k = 0; k < 3; ++k) {
      const double root = mean_joints[k] + pose.root_translation_m[k];
      in[k] =
          (moved[k] + mean.t[k] - root - example.statistics.mean[k]) * example.statistics.scale[k];
      in[3 + k] =
          (normal[k] / length - example.statistics.mean[3 + k]) * example.statistics.scale[3 + k];
    }
    const size_t texel = example.texel[i];
    for (uint32_t o = 0; o < example.fourier_octaves; ++o) {
      const double u = M_PI * (1u << o) * (double(texel % size) + 0.5) / double(size),
                   v = M_PI * (1u << o) * (double(texel / size) + 0.5) / double(size);
      const double waves[4] = {std::sin(u), std::cos(u), std::sin(v), std::cos(v)};
      for (int k = 0; k < 4; ++k) in[kMapChannels + 4 * o + k] = waves[k];
    }
    std::vector<double> h(outputs);
    for (size_t row = 0; row < outputs; ++row) {
      h[row] = example.network_bias[row];
      for (size_t c = 0; c < inputs; ++c)
        h[row] += example.network_weights[row * inputs + c] * in[c];
    }
    double canonical[3];
    for (size_t k = 0; k < 3; ++k)
      canonical[k] = own_texels[3 * i + k] + example.decoding.offset_scale_m * h[k];
    Gaussian64 gaussian;
    gaussian.centre_m = times(own.a, canonical);
    for (int k = 0; k < 3; ++k) gaussian.centre_m[k] += own.t[k];
    gaussian.factor = multiply(own.a, rotation(1 + h[6], h[7], h[8], h[9]));
    const double bound = example.decoding.max_log_scale,
                 unit = double(example.decoding.spacing_scale) * example.spacing[i];
    for (size_t k = 0; k < 9; ++k)
      gaussian.factor[k] *= unit * std::exp(std::min(std::max(h[3 + k % 3], -bound), bound));
    gaussians.push_back(gaussian);
  }
  return gaussians;
}

}  // namespace figurine::stability
