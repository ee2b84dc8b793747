#include "runtime/src/sample/device_transformer.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "figurine/detail/double_math.h"
#include "runtime/src/base/float_math.h"

namespace figurine {

namespace {

constexpr double
    kSlowest = 1.0 / 20,
    kFastest = 20;  // radians a unit of lambda, as toolchain/generate/transformer.cpp has them
constexpr double kTurn = 6.283185307179586;
constexpr double kNormEpsilon = 1e-5;
constexpr size_t kMatricesOfABlock = 4;
constexpr float kLog2E = 1.44269504f;

// Sums in double, one after the other: a mean over hundreds of values costs nothing beside a
// matrix.
void layer_norm(const float* x, size_t width, const float* weight, const float* bias, float* y) {
  double sum = 0, squares = 0;
  for (size_t k = 0; k < width; ++k) sum += double{x[k]};
  const double mean = sum / static_cast<double>(width);
  for (size_t k = 0; k < width; ++k) squares += (double{x[k]} - mean) * (double{x[k]} - mean);
  const double factor = 1.0 / std::sqrt(squares / static_cast<double>(width) + kNormEpsilon);
  for (size_t k = 0; k < width; ++k)
    y[k] = static_cast<float>((double{x[k]} - mean) * factor) * weight[k] + bias[k];
}

void gelu(float* x, size_t count) {
  for (size_t k = 0; k < count; ++k) x[k] = 0.5f * x[k] * (1.0f + erf_float(x[k] * 0.70710678f));
}

// Scores [count] to weights that sum to 1.
void softmax(float* x, size_t count) {
  float largest = x[0];
  for (size_t k = 1; k < count; ++k) largest = std::max(largest, x[k]);
  for (size_t k = 0; k < count; ++k) x[k] = exp2_minus((largest - x[k]) * kLog2E);
  double sum = 0;
  for (size_t k = 0; k < count; ++k) sum += double{x[k]};
  const auto factor = static_cast<float>(1.0 / sum);
  for (size_t k = 0; k < count; ++k) x[k] *= factor;
}

}  // namespace

DeviceTransformer::DeviceTransformer(const Sampler& sampler, const KernelTable& kernels)
    : sampler_(&sampler),
      kernels_(kernels),
      tokens_(sampler.ranks.size() + 1),
      width_(sampler.denoiser.d_model),
      padded_tokens_((tokens_ + 7) / 8 * 8) {
  size_t value = 0, row = 0;
  for (const MatrixShape& shape : denoiser_matrices(sampler.denoiser, sampler.ranks)) {
    const size_t size = size_t{shape.rows} * shape.columns;
    matrices_.push_back({sampler.matrices.subspan(value, size),
                         sampler.row_scale.subspan(row, shape.rows),
                         sampler.bias.subspan(row, shape.rows)});
    value += size, row += shape.rows;
  }
  const size_t half = width_ / 2;
  const double range = log_double(kFastest / kSlowest);
  for (size_t k = 0; k < half; ++k) {
    const double step = static_cast<double>(k) / static_cast<double>(std::max<size_t>(1, half - 1));
    frequency_.push_back(kSlowest * exp_double(step * range) / kTurn);
  }
}

bool DeviceTransformer::allocate() {
  const size_t feed_forward = sampler_->denoiser.feed_forward,
               head = width_ / sampler_->denoiser.heads;
  size_t columns = std::max(width_, feed_forward);
  for (const uint32_t rank : sampler_->ranks) columns = std::max<size_t>(columns, rank);
  return rounded_.ensure(tokens_, columns) &&
         row_.ensure((columns + kernels::kDotMultiple - 1) / kernels::kDotMultiple *
                     kernels::kDotMultiple) &&
         token_.ensure(tokens_ * width_) && normed_.ensure(tokens_ * width_) &&
         projected_.ensure(tokens_ * std::max(3 * width_, columns)) &&
         attended_.ensure(tokens_ * width_) && difference_.ensure(tokens_ * width_) &&
         keys_.ensure(head * padded_tokens_) && scores_.ensure(padded_tokens_);
}

Result<std::unique_ptr<DeviceTransformer>> DeviceTransformer::create(const Sampler& sampler,
                                                                     const KernelTable& kernels) {
  std::unique_ptr<DeviceTransformer> transformer(new (std::nothrow)
                                                     DeviceTransformer(sampler, kernels));
  if (transformer == nullptr || !transformer->allocate())
    return out_of_memory("the sampler's transformer");
  return transformer;
}

uint64_t DeviceTransformer::memory_bytes() const {
  return rounded_.memory_bytes() + row_.memory_bytes() + token_.memory_bytes() +
         normed_.memory_bytes() + projected_.memory_bytes() + attended_.memory_bytes() +
         difference_.memory_bytes() + keys_.memory_bytes() + scores_.memory_bytes();
}

void DeviceTransformer::multiply(const IntegerMatrix& matrix, const float* x, size_t rows,
                                 size_t x_stride, float* y, size_t y_stride) {
  rounded_.round(x, rows, matrix.columns(), x_stride);
  figurine::multiply(kernels_, matrix, rounded_, row_.span(rounded_.length()), y, y_stride);
}

// The time token: sines, then cosines, through two layers.
void DeviceTransformer::embed(double lambda) {
  const size_t half = width_ / 2, first = sampler_->ranks.size();
  float *wave = projected_.data(), *hidden = normed_.data();
  for (size_t k = 0; k < half; ++k) {
    const double turns = lambda * frequency_[k];
    const double fraction = turns - double_math::round_small(turns);  // -1/2 to 1/2
    const SineCosine value = sine_cosine_of_turns(fraction < 0 ? fraction + 1 : fraction);
    wave[k] = static_cast<float>(value.sine);
    wave[half + k] = static_cast<float>(value.cosine);
  }
  multiply(matrices_[first], wave, 1, width_, hidden, width_);
  for (size_t k = 0; k < width_; ++k) hidden[k] *= logistic(hidden[k]);  // SiLU
  multiply(matrices_[first + 1], hidden, 1, width_, token_.data(), width_);
}

void DeviceTransformer::normalise(size_t which) {
  const float* weight = sampler_->norm.data() + which * 2 * width_;
  for (size_t i = 0; i < tokens_; ++i) {
    layer_norm(token_.data() + i * width_, width_, weight, weight + width_,
               normed_.data() + i * width_);
  }
}

// projected_ holds queries, keys and values [tokens,3,heads,d / heads]; attended_ becomes
// [tokens,d].
void DeviceTransformer::attend() {
  const size_t heads = sampler_->denoiser.heads, size = width_ / heads, stride = 3 * width_;
  const auto scale = static_cast<float>(1.0 / std::sqrt(static_cast<double>(size)));
  float* scores = scores_.data();
  for (size_t h = 0; h < heads; ++h) {
    const float *query = projected_.data() + h * size, *key = query + width_, *value = key + width_;
    for (size_t j = 0; j < tokens_; ++j) {
      for (size_t c = 0; c < size; ++c) keys_[c * padded_tokens_ + j] = key[j * stride + c];
    }
    for (size_t i = 0; i < tokens_; ++i) {
      std::fill_n(scores, padded_tokens_, 0.0f);
      for (size_t c = 0; c < size; ++c) {
        const float q = query[i * stride + c] * scale;
        const float* row = keys_.data() + c * padded_tokens_;
        for (size_t j = 0; j < padded_tokens_; ++j) scores[j] += q * row[j];
      }
      softmax(scores, tokens_);
      float* out = attended_.data() + i * width_ + h * size;
      std::fill_n(out, size, 0.0f);
      for (size_t j = 0; j < tokens_; ++j) {
        for (size_t c = 0; c < size; ++c) out[c] += scores[j] * value[j * stride + c];
      }
    }
  }
}

void DeviceTransformer::predict(std::span<const float> z, double lambda, std::span<float> x0) {
  const std::span<const uint32_t> ranks = sampler_->ranks;
  const size_t values = tokens_ * width_;
  embed(lambda);
  for (size_t l = 0, at = 0; l < ranks.size(); at += ranks[l++]) {
    multiply(matrices_[l], z.data() + at, 1, ranks[l], token_.data() + (l + 1) * width_, width_);
  }
  for (size_t k = 0; k < values; ++k) token_[k] += sampler_->position[k];

  const IntegerMatrix* matrix = matrices_.data() + ranks.size() + 2;
  const auto add_difference = [&] {
    for (size_t k = 0; k < values; ++k) token_[k] += difference_[k];
  };
  for (size_t b = 0; b < sampler_->denoiser.blocks; ++b, matrix += kMatricesOfABlock) {
    normalise(2 * b);
    multiply(matrix[0], normed_.data(), tokens_, width_, projected_.data(), 3 * width_);
    attend();
    multiply(matrix[1], attended_.data(), tokens_, width_, difference_.data(), width_);
    add_difference();
    normalise(2 * b + 1);
    const size_t hidden = matrix[2].rows();
    multiply(matrix[2], normed_.data(), tokens_, width_, projected_.data(), hidden);
    gelu(projected_.data(), tokens_ * hidden);
    multiply(matrix[3], projected_.data(), tokens_, hidden, difference_.data(), width_);
    add_difference();
  }
  normalise(2 * size_t{sampler_->denoiser.blocks});
  for (size_t l = 0, at = 0; l < ranks.size(); at += ranks[l++]) {
    multiply(matrix[l], normed_.data() + (l + 1) * width_, 1, width_, x0.data() + at, ranks[l]);
  }
}

}  // namespace figurine
