#include "toolchain/model/adamw.h"

#include <cmath>

namespace figurine::model {

AdamW::AdamW(uint64_t parameters, const AdamWOptions& options)
    : first_moment(torch::zeros({static_cast<int64_t>(parameters)})),
      second_moment(torch::zeros({static_cast<int64_t>(parameters)})),
      options_(options) {}

bool AdamW::step(torch::Tensor& weights, const torch::Tensor& gradients, double learning_rate) {
  TORCH_CHECK(weights.numel() == first_moment.numel() && gradients.numel() == weights.numel(), "AdamW: sizes differ");
  TORCH_CHECK(weights.is_contiguous() && gradients.is_contiguous(), "AdamW: contiguous tensors");
  const int64_t count = weights.numel();
  float *const w = weights.mutable_data_ptr<float>(), *const m = first_moment.mutable_data_ptr<float>(),
               *const v = second_moment.mutable_data_ptr<float>();
  const float* const g = gradients.const_data_ptr<float>();
  // x * 0 is NaN exactly where x is not finite: lanes of sums vectorise, a test per value would not.
  float probe[16] = {};
  int64_t i = 0;
  for (; i + 16 <= count; i += 16) {
    for (int lane = 0; lane < 16; ++lane) probe[lane] += g[i + lane] * 0.0f;
  }
  for (; i < count; ++i) probe[0] += g[i] * 0.0f;
  for (float value : probe) {
    if (!(value == 0)) return false;
  }
  ++steps;
  const double correction1 = 1 - std::pow(options_.beta1, static_cast<double>(steps)),
               correction2 = 1 - std::pow(options_.beta2, static_cast<double>(steps));
  const float beta1 = static_cast<float>(options_.beta1), beta2 = static_cast<float>(options_.beta2);
  const float one_minus1 = static_cast<float>(1 - options_.beta1), one_minus2 = static_cast<float>(1 - options_.beta2);
  const float rate = static_cast<float>(learning_rate / correction1), root2 = static_cast<float>(1 / std::sqrt(correction2));
  const float epsilon = static_cast<float>(options_.epsilon), keep = static_cast<float>(1 - learning_rate * options_.weight_decay);
  for (int64_t k = 0; k < count; ++k) {
    m[k] = beta1 * m[k] + one_minus1 * g[k];
    v[k] = beta2 * v[k] + one_minus2 * (g[k] * g[k]);
    w[k] = keep * w[k] - rate * m[k] / (std::sqrt(v[k]) * root2 + epsilon);
  }
  return true;
}

}  // namespace figurine::model
