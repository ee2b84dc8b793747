// A body of texels without a mesh, for the model's tests and its bench: a capsule 1.75 m tall that
// faces +z, with a bent three-joint skeleton.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "figurine/body.h"

namespace figurine::testing {

struct SyntheticBody {
  std::vector<int16_t> parents{-1, 0, 1};
  std::vector<float> joints{0, 0, 0, 0, 0.6f, 0, 0, 1.2f, 0};
  std::vector<uint32_t> texel;
  std::vector<float> position, normal, weights, spacing;
  std::vector<uint8_t> texel_joints;
  Body body;

  // rows x uv_size texels are covered.
  SyntheticBody(uint32_t uv_size, uint32_t rows) {
    constexpr double kPi = 3.14159265358979323846, kHeight = 1.75, kRadius = 0.17;
    for (uint32_t v = 0; v < rows; ++v) {
      for (uint32_t u = 0; u < uv_size; ++u) {
        const double angle = 2 * kPi * (u + 0.5) / uv_size, along = (v + 0.5) / rows;
        const double radius = kRadius * std::sqrt(std::max(0.02, 1 - std::pow(2 * along - 1, 6)));
        texel.push_back((v + (uv_size - rows) / 2) * uv_size + u);
        const double p[3] = {radius * std::sin(angle), kHeight * (1 - along),
                             radius * std::cos(angle)};
        for (double value : p) position.push_back(static_cast<float>(value));
        for (double value : {std::sin(angle), 0.0, std::cos(angle)})
          normal.push_back(static_cast<float>(value));
        spacing.push_back(
            static_cast<float>(std::sqrt(kHeight / rows * 2 * kPi * kRadius / uv_size)));
        double w[3];
        double sum = 0;
        for (int j = 0; j < 3; ++j) sum += w[j] = std::exp(-8 * std::pow(p[1] - 0.3 - 0.6 * j, 2));
        for (uint32_t k = 0; k < kSkinInfluences; ++k) {
          texel_joints.push_back(static_cast<uint8_t>(k < 3 ? k : 0));
          weights.push_back(k < 3 ? static_cast<float>(w[k] / sum) : 0.0f);
        }
      }
    }
    body = {.name = "capsule",
            .uv_size = uv_size,
            .joint_names = {"a", "b", "c"},
            .parents = parents,
            .joint_position_m = joints,
            .joint_shape_basis_m = {},
            .texel = texel,
            .texel_position_m = position,
            .texel_normal = normal,
            .texel_joints = texel_joints,
            .texel_weights = weights,
            .texel_spacing_m = spacing,
            .texel_shape_basis_m = {},
            .border_texel = {},
            .border_source = {}};
  }
  SyntheticBody(const SyntheticBody&) = delete;

  // A bent pose's skinning transforms.
  std::vector<Affine> bent() const {
    const std::vector<float> rotations{0.98f, 0.05f,  0.17f, 0.02f,  0.96f, 0.2f,
                                       0.1f,  -0.05f, 0.95f, -0.15f, 0.1f,  0.2f};
    std::vector<Affine> transforms(3);
    skinning_transforms(body.mean_skeleton(),
                        {.root_translation_m = {0.02f, 0.01f, -0.03f}, .rotations = rotations},
                        transforms);
    return transforms;
  }
};

}  // namespace figurine::testing
