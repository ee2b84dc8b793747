#include "toolchain/model/loss.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "toolchain/model/parallel.h"
#include "toolchain/model/ssim.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

constexpr uint32_t kChunk = 8192;  // pixels per task

struct ChunkSums {
  double l1 = 0, mask = 0, squared_error = 0;
  uint64_t foreground = 0;
};

// Partial sums by lane vectorise without reordering what the compiler may not. 512 values of order
// one in each, so float keeps five digits.
constexpr uint32_t kLanes = 16;

double total(const float* lanes) {
  double sum = 0;
  for (uint32_t lane = 0; lane < kLanes; ++lane) sum += double(lanes[lane]);
  return sum;
}

// One channel of `count` pixels (a multiple of kLanes): both images over the background, and the
// sums of their differences.
void compose(uint32_t count, float background, const float* __restrict a, const float* __restrict b,
             const float* __restrict alpha, const float* __restrict mask, float* __restrict x,
             float* __restrict y, float* __restrict l1_lanes, float* __restrict squared_lanes) {
  float l1[kLanes] = {}, squared[kLanes] = {};
  for (uint32_t i = 0; i < count; i += kLanes) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      const uint32_t at = i + lane;
      const float seen = a[at] + (1 - alpha[at]) * background,
                  truth = b[at] + (1 - mask[at]) * background, difference = seen - truth;
      x[at] = seen;
      y[at] = truth;
      l1[lane] += std::fabs(difference);
      squared[lane] += mask[at] > 0.5f ? difference * difference : 0.0f;
    }
  }
  for (uint32_t lane = 0; lane < kLanes; ++lane)
    l1_lanes[lane] += l1[lane], squared_lanes[lane] += squared[lane];
}

void compare_masks(uint32_t count, const float* __restrict alpha, const float* __restrict mask,
                   float* __restrict l1_lanes, float* __restrict inside_lanes) {
  float l1[kLanes] = {}, inside[kLanes] = {};
  for (uint32_t i = 0; i < count; i += kLanes) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      l1[lane] += std::fabs(alpha[i + lane] - mask[i + lane]);
      inside[lane] += mask[i + lane] > 0.5f ? 1.0f : 0.0f;
    }
  }
  for (uint32_t lane = 0; lane < kLanes; ++lane)
    l1_lanes[lane] += l1[lane], inside_lanes[lane] += inside[lane];
}

inline float sign(float value) { return float(value > 0) - float(value < 0); }

struct GradientScales {
  float l1 = 0, ssim = 0, mask = 0;
};

void mask_gradient(uint32_t count, float scale, const float* __restrict alpha,
                   const float* __restrict mask, float* __restrict d_alpha) {
  for (uint32_t i = 0; i < count; ++i) d_alpha[i] = scale * sign(alpha[i] - mask[i]);
}

// One channel's gradient; adds its share of the alpha's, through the background.
void colour_gradient(uint32_t count, const GradientScales& scales, float background,
                     const float* __restrict x, const float* __restrict y,
                     const float* __restrict by_ssim, float* __restrict gradient,
                     float* __restrict d_alpha) {
  const float l1 = scales.l1, ssim = scales.ssim;
  for (uint32_t i = 0; i < count; ++i) {
    const float d = l1 * sign(x[i] - y[i]) - ssim * by_ssim[i];
    gradient[i] = d;
    d_alpha[i] -= background * d;
  }
}

// The loss and its gradient by the image, in one go: the gradient is always wanted in training.
struct Computed {
  LossTerms terms;
  torch::Tensor gradient;  // [4,h,w]
};

Computed compute(const torch::Tensor& image, const torch::Tensor& target,
                 const std::array<float, 3>& background, const LossOptions& options) {
  TORCH_CHECK(image.dim() == 3 && image.size(0) == 4 && target.sizes() == image.sizes(),
              "image_loss: image and target must be [4,h,w]");
  TORCH_CHECK(image.scalar_type() == torch::kFloat && target.scalar_type() == torch::kFloat,
              "image_loss: float images");
  const torch::Tensor seen = image.contiguous(), truth = target.contiguous();
  const uint32_t height = static_cast<uint32_t>(image.size(1)),
                 width = static_cast<uint32_t>(image.size(2)), pixels = height * width;
  const float *a = seen.const_data_ptr<float>(), *b = truth.const_data_ptr<float>();
  Computed result;
  result.gradient = torch::empty_like(seen);
  float* const gradient = result.gradient.mutable_data_ptr<float>();
  // Both images over the background, [3,h,w] each: what L1 and SSIM compare.
  static thread_local std::vector<float> composed;
  static thread_local std::vector<float> ssim_gradient;
  static thread_local SsimScratch<float> scratch;
  composed.resize(size_t(6) * pixels);
  float *x = composed.data(), *y = x + size_t(3) * pixels;
  const uint32_t chunks = (pixels + kChunk - 1) / kChunk;
  std::vector<ChunkSums> sums(chunks);
  parallel_for(options.threads, chunks, [&](uint32_t chunk) {
    const uint32_t begin = chunk * kChunk, end = std::min(pixels, begin + kChunk);
    const float *alpha = a + size_t(3) * pixels, *mask = b + size_t(3) * pixels;
    float l1[kLanes] = {}, squared[kLanes] = {}, mask_l1[kLanes] = {}, inside[kLanes] = {};
    // What does not fill the lanes is copied into buffers that do; zeros are equal in both images.
    const uint32_t whole = (end - begin) / kLanes * kLanes, tail = end - begin - whole;
    float tails[6][kLanes] = {};
    for (uint32_t c = 0; c < 3; ++c) {
      const size_t at = size_t(c) * pixels + begin;
      compose(whole, background[c], a + at, b + at, alpha + begin, mask + begin, x + at, y + at, l1,
              squared);
      if (tail == 0) continue;
      const float* const from[4] = {a + at + whole, b + at + whole, alpha + begin + whole,
                                    mask + begin + whole};
      for (int k = 0; k < 4; ++k) std::copy_n(from[k], tail, tails[k]);
      compose(kLanes, background[c], tails[0], tails[1], tails[2], tails[3], tails[4], tails[5], l1,
              squared);
      std::copy_n(tails[4], tail, x + at + whole);
      std::copy_n(tails[5], tail, y + at + whole);
    }
    compare_masks(whole, alpha + begin, mask + begin, mask_l1, inside);
    if (tail != 0) compare_masks(kLanes, tails[2], tails[3], mask_l1, inside);
    sums[chunk] = {total(l1), total(mask_l1), total(squared), static_cast<uint64_t>(total(inside))};
  });
  for (const ChunkSums& sum : sums) {
    result.terms.l1 += static_cast<float>(sum.l1 / (3.0 * pixels));
    result.terms.mask += static_cast<float>(sum.mask / pixels);
    result.terms.squared_error += sum.squared_error;
    result.terms.foreground += sum.foreground;
  }
  const bool with_ssim = options.ssim_weight != 0;
  result.terms.ssim = 1;
  ssim_gradient.resize(size_t(3) * pixels);
  if (with_ssim) {
    result.terms.ssim = static_cast<float>(
        ssim<float>({x, y, 3, height, width}, options.threads, scratch, ssim_gradient.data()));
  } else {
    std::fill(ssim_gradient.begin(), ssim_gradient.end(), 0.0f);
  }
  const GradientScales scales{.l1 = options.l1_weight / (3.0f * static_cast<float>(pixels)),
                              .ssim = options.ssim_weight,
                              .mask = options.mask_weight / static_cast<float>(pixels)};
  const float* const by_ssim = ssim_gradient.data();
  parallel_for(options.threads, chunks, [&](uint32_t chunk) {
    const uint32_t begin = chunk * kChunk, count = std::min(pixels, begin + kChunk) - begin;
    const size_t alpha = size_t(3) * pixels + begin;
    mask_gradient(count, scales.mask, a + alpha, b + alpha, gradient + alpha);
    for (uint32_t c = 0; c < 3; ++c) {
      const size_t at = size_t(c) * pixels + begin;
      colour_gradient(count, scales, background[c], x + at, y + at, by_ssim + at, gradient + at,
                      gradient + alpha);
    }
  });
  result.terms.total = options.l1_weight * result.terms.l1 +
                       options.ssim_weight * (1 - result.terms.ssim) +
                       options.mask_weight * result.terms.mask;
  return result;
}

class ImageLoss : public torch::autograd::Function<ImageLoss> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context,
                               const torch::Tensor& image, const torch::Tensor& target,
                               const std::array<float, 3>& background, const LossOptions& options,
                               LossTerms* terms) {
    Computed computed = compute(image, target, background, options);
    context->saved_data["gradient"] = computed.gradient;
    if (terms) *terms = computed.terms;
    return torch::tensor(computed.terms.total);
  }
  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list output_gradients) {
    const torch::Tensor gradient = context->saved_data["gradient"].toTensor();
    const float scale = output_gradients[0].item<float>();
    return {scale == 1.0f ? gradient : gradient * scale, {}, {}, {}, {}};
  }
};

}  // namespace

torch::Tensor image_loss(const torch::Tensor& image, const torch::Tensor& target,
                         const std::array<float, 3>& background, const LossOptions& options,
                         LossTerms* terms) {
  return ImageLoss::apply(image, target, background, options, terms);
}

}  // namespace figurine::model
