#include "figurine/body.h"

#include <cstring>

#include "figurine/detail/double_math.h"

namespace figurine {

void shape_body(const Body& body, std::span<const float> shape, std::span<float> joint_position_m,
                std::span<float> texel_position_m) {
  FIG_CHECK(shape.size() <= body.shape_count(),
            "more shape coefficients than the body has directions");
  FIG_CHECK(joint_position_m.size() == body.joint_position_m.size() &&
                texel_position_m.size() == body.texel_position_m.size(),
            "array sizes");
  const auto add = [&](std::span<const float> mean, std::span<const float> basis,
                       std::span<float> out) {
    std::memcpy(out.data(), mean.data(), mean.size_bytes());
    for (size_t s = 0; s < shape.size(); ++s) {
      const float* direction = basis.data() + s * mean.size();
      for (size_t i = 0; i < mean.size(); ++i) out[i] += shape[s] * direction[i];
    }
  };
  add(body.joint_position_m, body.joint_shape_basis_m, joint_position_m);
  add(body.texel_position_m, body.texel_shape_basis_m, texel_position_m);
}

void draw_pose_maps(const Body& body, const PoseView& pose, const MapStatistics& statistics,
                    std::span<Affine> scratch, uint32_t stride, std::span<float> maps) {
  FIG_CHECK(stride >= kMapChannels && maps.size() >= size_t(body.uv_size) * body.uv_size * stride,
            "map size");
  const SkeletonView skeleton = body.mean_skeleton();
  skinning_transforms(skeleton, pose, scratch);
  const std::array<float, 3> root = root_position(skeleton, pose);
  for (size_t t = 0; t < size_t(body.uv_size) * body.uv_size; ++t) {
    for (uint32_t c = 0; c < kMapChannels; ++c) maps[t * stride + c] = 0;
  }
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const Affine transform = blend(scratch, &body.texel_joints[size_t(i) * kSkinInfluences],
                                   &body.texel_weights[size_t(i) * kSkinInfluences]);
    const std::array<float, 3> position =
        transform_point(transform, &body.texel_position_m[size_t(i) * 3]);
    const std::array<float, 3> normal =
        transform_normal(transform, &body.texel_normal[size_t(i) * 3]);
    float* out = &maps[size_t(body.texel[i]) * stride];
    for (size_t k = 0; k < 3; ++k) {
      out[k] = ((position[k] - root[k]) - statistics.mean[k]) * statistics.scale[k];
      out[3 + k] = (normal[k] - statistics.mean[3 + k]) * statistics.scale[3 + k];
    }
  }
  for (size_t i = 0; i < body.border_texel.size(); ++i) {
    const float* from = &maps[size_t(body.texel[body.border_source[i]]) * stride];
    float* to = &maps[size_t(body.border_texel[i]) * stride];
    for (uint32_t c = 0; c < kMapChannels; ++c) to[c] = from[c];
  }
}

void draw_fourier_channels(uint32_t uv_size, uint32_t octaves, uint32_t first, uint32_t stride,
                           std::span<float> maps) {
  if (octaves == 0) return;  // no channel, and maybe no memory to draw it in
  FIG_CHECK(first + 4 * octaves <= stride && maps.size() >= size_t(uv_size) * uv_size * stride,
            "map size");
  // pi 2^o (u + 0.5) / T is 2^o (2 u + 1) / (4 T) turns; whole turns go away in integers.
  const auto wave = [turn = 4 * uv_size](uint32_t octave, uint32_t texel) {
    const uint64_t angle = (uint64_t{2 * texel + 1} << octave) % turn;
    return sine_cosine_of_turns(static_cast<double>(angle) / turn);
  };
  const auto channels_at = [&](uint32_t u, uint32_t v) {
    return &maps[(size_t{v} * uv_size + u) * stride + first];
  };
  // Every value is that of a whole column or of a whole row.
  for (uint32_t o = 0; o < octaves; ++o) {
    for (uint32_t texel = 0; texel < uv_size; ++texel) {
      const SineCosine at = wave(o, texel);
      const float sine = static_cast<float>(at.sine), cosine = static_cast<float>(at.cosine);
      for (uint32_t other = 0; other < uv_size; ++other) {
        float* const in_column = channels_at(texel, other) + 4 * o;
        in_column[0] = sine;
        in_column[1] = cosine;
        float* const in_row = channels_at(other, texel) + 4 * o;
        in_row[2] = sine;
        in_row[3] = cosine;
      }
    }
  }
}

}  // namespace figurine
