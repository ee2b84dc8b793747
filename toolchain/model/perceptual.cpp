#include "toolchain/model/perceptual.h"

#include <algorithm>

#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

// [3,h,w] of the window, seen over the background.
torch::Tensor over(const torch::Tensor& image, const torch::Tensor& behind,
                   const PixelRect& window) {
  const torch::Tensor part =
      image.narrow(1, window.y, window.height).narrow(2, window.x, window.width);
  return part.narrow(0, 0, 3) + (1 - part.narrow(0, 3, 1)) * behind;
}

}  // namespace

torch::Tensor perceptual_loss(const torch::Tensor& image, const torch::Tensor& target,
                              const std::array<float, 3>& background, const PixelRect& window,
                              const PictureDistance& distance) {
  TORCH_CHECK(image.dim() == 3 && image.size(0) == 4 && target.sizes() == image.sizes() &&
                  window.x + window.width <= image.size(2) &&
                  window.y + window.height <= image.size(1),
              "perceptual_loss: image and target must be [4,h,w], the window inside of them");
  if (std::min(window.width, window.height) < distance.least_side_px())
    return torch::zeros({}, torch::kFloat);
  const torch::Tensor behind =
      torch::tensor({background[0], background[1], background[2]}).view({3, 1, 1});
  const torch::Tensor truth = [&] {
    const torch::NoGradGuard no_gradient;
    return over(target, behind, window);
  }();
  return distance.between(over(image, behind, window), truth);
}

}  // namespace figurine::model
