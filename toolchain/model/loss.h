// The first stage's image loss: L1 + SSIM (ssim.h) + mask, forward and analytic backward fused in
// threaded C++.
//
// Weights are the paper's, 1.0 / 0.1 / 0.1, for L1, 1 - SSIM and L1 of the mask; its LPIPS term
// (0.01) is perceptual.h.
#pragma once

#include <array>
#include <cstdint>

#include "toolchain/tensor.h"

namespace figurine::model {

struct LossOptions {
  float l1_weight = 1.0f;
  float ssim_weight = 0.1f;  // 0 leaves its computation out
  float mask_weight = 0.1f;
  uint32_t threads = 1;
};

struct LossTerms {
  float total = 0;
  float l1 = 0;              // mean |difference| over pixels and channels
  float ssim = 0;            // mean SSIM itself, 1 is equal; 1 where it was not asked for
  float mask = 0;            // mean |alpha - mask|
  double squared_error = 0;  // summed over channels of pixels whose true alpha exceeds 0.5
  uint64_t foreground = 0;   // number of those pixels
};

// image: [4,h,w] premultiplied R, G, B and alpha (AvatarRenderer); target: the same of the truth,
// alpha = mask. Both are seen over `background`: colour + (1 - alpha) background. Returns the
// scalar loss, differentiable by image; terms (may be null) are filled at once.
torch::Tensor image_loss(const torch::Tensor& image, const torch::Tensor& target,
                         const std::array<float, 3>& background, const LossOptions& options,
                         LossTerms* terms);

}  // namespace figurine::model
