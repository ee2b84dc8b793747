// A sampler of random numbers with its storage, in the size that a test asks for: for what is true
// of all samplers, trained or not.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "figurine/sampler.h"
#include "runtime/src/sample/noise.h"

namespace figurine::tests {

struct RandomSamplerShape {
  uint32_t uv_size = 16, channels = 2, rank = 5, shape_count = 3;
  DenoiserShape denoiser{.d_model = 32, .blocks = 2, .heads = 4, .feed_forward = 48};
  float contrast = 1;  // of the matrices: 1 keeps values near 1
};

class RandomSampler {
 public:
  explicit RandomSampler(const RandomSamplerShape& shape = {}, uint64_t seed = 1) {
    view.name = "random";
    view.network = make_pose_unet(shape.uv_size, kMapChannels, shape.channels, head_channels(0));
    view.shape_count = shape.shape_count;
    view.values.assign(view.network.layers.size(), {.scale = 0.05f, .zero_point = -128});
    view.values[0] = {.scale = 1e-4f, .zero_point = 0};
    view.denoiser = shape.denoiser;
    for (const size_t size : sampler_token_sizes(view)) {
      view.ranks.push_back(shape.rank);
      fill(seed, directions, shape.rank * size);
      for (uint32_t k = 0; k < shape.rank; ++k) direction_scale.push_back(0.002f);
      for (size_t j = 0; j < size; ++j) mean.push_back(0.01f);
    }
    for (const MatrixShape& matrix : denoiser_matrices(view.denoiser, view.ranks)) {
      fill(seed, matrices, size_t{matrix.rows} * matrix.columns);
      for (uint32_t n = 0; n < matrix.rows; ++n) {
        row_scale.push_back(shape.contrast /
                            (73.0f * std::sqrt(static_cast<float>(matrix.columns))));
        bias.push_back(0.01f * static_cast<float>(static_cast<int>(n % 7) - 3));
      }
    }
    const uint32_t d = view.denoiser.d_model;
    for (size_t k = 0; k < (view.ranks.size() + 1) * d; ++k)
      position.push_back(0.1f * static_cast<float>(static_cast<int>(k % 11) - 5));
    for (size_t k = 0; k < size_t{2 * view.denoiser.blocks + 1} * 2; ++k)
      norm.insert(norm.end(), d, k % 2 == 0 ? 1.0f : 0.05f);
    view.mean = mean, view.directions = directions, view.direction_scale = direction_scale;
    view.matrices = matrices, view.row_scale = row_scale, view.bias = bias,
    view.position = position, view.norm = norm;
    view.noise.dimension = direction_scale.size();
  }
  RandomSampler(const RandomSampler&) = delete;

  Sampler view;
  std::vector<float> mean, direction_scale, row_scale, bias, position, norm;
  std::vector<int8_t> directions, matrices;

 private:
  // Integers from -127 to 127, each as likely; their deviation is 73.
  static void fill(uint64_t seed, std::vector<int8_t>& out, size_t count) {
    for (size_t k = 0; k < count; ++k) {
      const uint32_t word = philox4x32_10({static_cast<uint32_t>(out.size()), 0, 0, 0},
                                          {static_cast<uint32_t>(seed), 7})[0];
      out.push_back(static_cast<int8_t>(static_cast<int>(word % 255) - 127));
    }
  }
};

}  // namespace figurine::tests
