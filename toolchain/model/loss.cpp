#include "toolchain/model/loss.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "toolchain/model/parallel.h"
#include "toolchain/model/ssim.h"

namespace figurine::model {

namespace {

constexpr uint32_t kChunk = 8192;  // pixels per task

struct ChunkSums {
  double l1 = 0, mask = 0, squared_error = 0;
  uint64_t foreground = 0;
};

// Partial sums that vectorise without reordering what the compiler may not: 512 values of order one in each, so float keeps five digits.
constexpr uint32_t kLanes = 16;
using Lanes = std::array<float, kLanes>;

template <class Add>
inline void add_by_lane(uint32_t begin, uint32_t end, Add&& add) {
  uint32_t i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    for (uint32_t lane = 0; lane < kLanes; ++lane) add(i + lane, lane);
  }
  for (; i < end; ++i) add(i, 0);
}

double total(const Lanes& lanes) {
  double sum = 0;
  for (float value : lanes) sum += double(value);
  return sum;
}

float sign(float value) { return value > 0 ? 1.0f : value < 0 ? -1.0f : 0.0f; }

// The loss and its gradient by the image, in one go: the gradient is always wanted in training.
struct Computed {
  LossTerms terms;
  torch::Tensor gradient;  // [4,h,w]
};

Computed compute(const torch::Tensor& image, const torch::Tensor& target, const std::array<float, 3>& background,
                 const LossOptions& options) {
  TORCH_CHECK(image.dim() == 3 && image.size(0) == 4 && target.sizes() == image.sizes(), "image_loss: image and target must be [4,h,w]");
  TORCH_CHECK(image.scalar_type() == torch::kFloat && target.scalar_type() == torch::kFloat, "image_loss: float images");
  const torch::Tensor seen = image.contiguous(), truth = target.contiguous();
  const uint32_t height = static_cast<uint32_t>(image.size(1)), width = static_cast<uint32_t>(image.size(2)), pixels = height * width;
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
    Lanes l1{}, squared{}, mask_l1{}, inside{};
    for (uint32_t c = 0; c < 3; ++c) {
      const size_t plane = size_t(c) * pixels;
      add_by_lane(begin, end, [&](uint32_t i, uint32_t lane) {
        x[plane + i] = a[plane + i] + (1 - alpha[i]) * background[c];
        y[plane + i] = b[plane + i] + (1 - mask[i]) * background[c];
        const float difference = x[plane + i] - y[plane + i];
        l1[lane] += std::fabs(difference);
        squared[lane] += mask[i] > 0.5f ? difference * difference : 0.0f;
      });
    }
    add_by_lane(begin, end, [&](uint32_t i, uint32_t lane) {
      mask_l1[lane] += std::fabs(alpha[i] - mask[i]);
      inside[lane] += mask[i] > 0.5f ? 1.0f : 0.0f;
    });
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
  if (with_ssim) {
    ssim_gradient.resize(size_t(3) * pixels);
    result.terms.ssim = static_cast<float>(ssim<float>({x, y, 3, height, width}, options.threads, scratch, ssim_gradient.data()));
  }
  const float l1_scale = options.l1_weight / (3.0f * static_cast<float>(pixels)),
              mask_scale = options.mask_weight / static_cast<float>(pixels);
  const float* const by_ssim = ssim_gradient.data();
  parallel_for(options.threads, chunks, [&](uint32_t chunk) {
    const uint32_t begin = chunk * kChunk, end = std::min(pixels, begin + kChunk);
    const float *alpha = a + size_t(3) * pixels, *mask = b + size_t(3) * pixels;
    float* const d_alpha = gradient + size_t(3) * pixels;
    for (uint32_t i = begin; i < end; ++i) d_alpha[i] = mask_scale * sign(alpha[i] - mask[i]);
    for (uint32_t c = 0; c < 3; ++c) {
      const size_t plane = size_t(c) * pixels;
      for (uint32_t i = begin; i < end; ++i) {
        float d = l1_scale * sign(x[plane + i] - y[plane + i]);
        if (with_ssim) d -= options.ssim_weight * by_ssim[plane + i];
        gradient[plane + i] = d;
        d_alpha[i] -= background[c] * d;
      }
    }
  });
  result.terms.total =
      options.l1_weight * result.terms.l1 + options.ssim_weight * (1 - result.terms.ssim) + options.mask_weight * result.terms.mask;
  return result;
}

class ImageLoss : public torch::autograd::Function<ImageLoss> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& image, const torch::Tensor& target,
                               const std::array<float, 3>& background, const LossOptions& options, LossTerms* terms) {
    Computed computed = compute(image, target, background, options);
    context->saved_data["gradient"] = computed.gradient;
    if (terms) *terms = computed.terms;
    return torch::tensor(computed.terms.total);
  }
  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context, torch::autograd::tensor_list output_gradients) {
    const torch::Tensor gradient = context->saved_data["gradient"].toTensor();
    const float scale = output_gradients[0].item<float>();
    return {scale == 1.0f ? gradient : gradient * scale, {}, {}, {}, {}};
  }
};

}  // namespace

torch::Tensor image_loss(const torch::Tensor& image, const torch::Tensor& target, const std::array<float, 3>& background,
                         const LossOptions& options, LossTerms* terms) {
  return ImageLoss::apply(image, target, background, options, terms);
}

}  // namespace figurine::model
