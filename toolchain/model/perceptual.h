// The perceptual term of the image loss: how differently a network sees two pictures, with its
// gradient by the picture. Which network that is, and how it weighs its layers, is the caller's
// (toolchain/features).
//
// It looks at a window of the pictures: a network's activations cost as much a pixel as all the
// rest of the loss, and a random window of every picture is in the mean the same.
//
// Based on: Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric,
// 2018, eq. 1; the paper, section 4.1 (its weight in the loss is 0.01).
#pragma once

#include <array>
#include <cstdint>

#include "toolchain/model/render.h"
#include "toolchain/tensor.h"

namespace figurine::model {

class PictureDistance {
 public:
  virtual ~PictureDistance() = default;
  virtual uint32_t least_side_px() const = 0;  // of pictures that the network can take
  // seen, truth: [3,h,w] float, sRGB over one background, no side below least_side_px(). A scalar,
  // differentiable by `seen`; 0 if they are equal. Called from several threads at once.
  virtual torch::Tensor between(const torch::Tensor& seen, const torch::Tensor& truth) const = 0;
};

// image, target, background: as image_loss has them (loss.h); window: inside of them. Returns the
// distance of both windows over the background, a scalar differentiable by image; a zero that does
// not depend on it where the window is too small for the network.
torch::Tensor perceptual_loss(const torch::Tensor& image, const torch::Tensor& target,
                              const std::array<float, 3>& background, const PixelRect& window,
                              const PictureDistance& distance);

}  // namespace figurine::model
