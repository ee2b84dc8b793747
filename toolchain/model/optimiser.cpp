#include "toolchain/model/optimiser.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/add.h>
#include <ATen/ops/zeros.h>

#include <algorithm>
#include <cmath>

#include "toolchain/model/muon.h"

namespace figurine::model {

namespace {

constexpr double kMuonStepRms =
    0.2;  // what AdamW's steps have in practice, in learning rates (Liu et al., section 2.2)

bool all_finite(const float* values, int64_t count) {
  // x * 0 is NaN exactly where x is not finite: lanes of sums vectorise, a test per value would
  // not.
  float probe[16] = {};
  int64_t i = 0;
  for (; i + 16 <= count; i += 16) {
    for (int lane = 0; lane < 16; ++lane) probe[lane] += values[i + lane] * 0.0f;
  }
  for (; i < count; ++i) probe[0] += values[i] * 0.0f;
  return std::all_of(std::begin(probe), std::end(probe), [](float value) { return value == 0; });
}

bool is_zero(const float* values, int64_t count) {
  return std::all_of(values, values + count, [](float value) { return value == 0; });
}

}  // namespace

double squared_norm(const torch::Tensor& gradients) {
  const float* values = gradients.const_data_ptr<float>();
  const int64_t count = gradients.numel();
  double sums[8] = {};  // squares of floats do not overflow double
  int64_t i = 0;
  for (; i + 8 <= count; i += 8) {
    for (int lane = 0; lane < 8; ++lane)
      sums[lane] += double(values[i + lane]) * double(values[i + lane]);
  }
  for (; i < count; ++i) sums[0] += double(values[i]) * double(values[i]);
  double sum = 0;
  for (const double part : sums) sum += part;
  return sum;
}

std::vector<ParameterGroup> adamw_group(uint64_t parameters) {
  return {{0, static_cast<int64_t>(parameters), 0}};
}

Optimiser::Optimiser(std::vector<ParameterGroup> groups, const OptimiserOptions& options)
    : groups_(std::move(groups)), options_(options) {
  int64_t parameters = 0;
  for (const ParameterGroup& group : groups_) {
    TORCH_CHECK(group.begin == parameters && group.end >= group.begin,
                "Optimiser: groups with a gap");
    TORCH_CHECK(group.matrix_rows == 0 || (group.end - group.begin) % group.matrix_rows == 0,
                "Optimiser: a group that is no matrix");
    parameters = group.end;
  }
  first_moment = torch::zeros({parameters});
  second_moment = torch::zeros({parameters});
}

bool Optimiser::step(torch::Tensor& weights, const torch::Tensor& gradients, double learning_rate) {
  TORCH_CHECK(weights.numel() == first_moment.numel() && gradients.numel() == weights.numel(),
              "Optimiser: sizes differ");
  TORCH_CHECK(weights.is_contiguous() && gradients.is_contiguous(),
              "Optimiser: contiguous tensors");
  if (!all_finite(gradients.const_data_ptr<float>(), gradients.numel())) return false;
  at::NoGradGuard no_gradient;
  ++steps;
  for (const ParameterGroup& group : groups_) {
    if (group.matrix_rows > 0) {
      step_muon(group, weights, gradients, learning_rate);
    } else {
      step_adamw(group, weights.mutable_data_ptr<float>(), gradients.const_data_ptr<float>(),
                 learning_rate);
    }
  }
  return true;
}

void Optimiser::step_adamw(const ParameterGroup& group, float* const w, const float* const g,
                           double learning_rate) {
  float *const m = first_moment.mutable_data_ptr<float>(), *const v =
                                                               second_moment
                                                                   .mutable_data_ptr<float>();
  const double correction1 = 1 - std::pow(options_.beta1, static_cast<double>(steps)),
               correction2 = 1 - std::pow(options_.beta2, static_cast<double>(steps));
  const float beta1 = static_cast<float>(options_.beta1),
              beta2 = static_cast<float>(options_.beta2);
  const float one_minus1 = static_cast<float>(1 - options_.beta1),
              one_minus2 = static_cast<float>(1 - options_.beta2);
  const float rate = static_cast<float>(learning_rate / correction1),
              root2 = static_cast<float>(1 / std::sqrt(correction2));
  const float epsilon = static_cast<float>(options_.epsilon),
              keep = static_cast<float>(1 - learning_rate * options_.weight_decay);
  for (int64_t k = group.begin; k < group.end; ++k) {
    m[k] = beta1 * m[k] + one_minus1 * g[k];
    v[k] = beta2 * v[k] + one_minus2 * (g[k] * g[k]);
    w[k] = keep * w[k] - rate * m[k] / (std::sqrt(v[k]) * root2 + epsilon);
  }
}

void Optimiser::step_muon(const ParameterGroup& group, torch::Tensor& weights,
                          const torch::Tensor& gradients, double learning_rate) {
  const int64_t count = group.end - group.begin, rows = group.matrix_rows, columns = count / rows;
  const auto matrix = [&](const torch::Tensor& flat) {
    return flat.narrow(0, group.begin, count).view({rows, columns});
  };
  const float momentum = static_cast<float>(options_.momentum),
              rest = static_cast<float>(1 - options_.momentum);
  const torch::Tensor gradient = matrix(gradients), mean = matrix(first_moment);
  mean.mul_(momentum).add_(gradient, rest);
  // However short the momentum, its step has the same length: a layer whose units are all off would
  // go on in the direction of its last gradient until its weights are no numbers.
  if (is_zero(gradients.const_data_ptr<float>() + group.begin, count)) return;
  const torch::Tensor direction = orthogonalised(at::add(mean * momentum, gradient, rest));
  // An orthogonal [rows, columns] matrix has elements of RMS 1 / sqrt(max(rows, columns)).
  const double size =
      learning_rate * kMuonStepRms * std::sqrt(static_cast<double>(std::max(rows, columns)));
  matrix(weights).mul_(1 - learning_rate * options_.weight_decay).sub_(direction, size);
}

}  // namespace figurine::model
