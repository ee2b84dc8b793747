// The differentiable picture: a head row per texel to the RGBA crop of one camera, as one torch
// operation (decode, skin, splat; analytic backward).
#pragma once

#include "toolchain/model/head.h"
#include "toolchain/model/splatter.h"
#include "toolchain/tensor.h"

namespace figurine::model {

struct RenderView {
  Camera camera;   // of the full image
  PixelRect crop;  // only these pixels are computed
};

struct RendererState;  // render.cpp

// Renders with buffers that are reused from call to call. One AvatarRenderer serves one training
// loop: a call's backward must be done before the next call.
class AvatarRenderer {
 public:
  explicit AvatarRenderer(const SplatterOptions& options);
  ~AvatarRenderer();

  // head: [N,C] float, contiguous (HeadComposer::forward's result). Returns [4, crop.height,
  // crop.width] float: premultiplied R, G, B and alpha. What `frame` borrows must live until the
  // backward pass is done.
  torch::Tensor render(const torch::Tensor& head, const HeadFrame& frame, const RenderView& view);

  // The Gaussians of the last render().
  const GaussianBuffer<float>& gaussians() const;
  const SplatterStatistics& statistics() const;

 private:
  c10::intrusive_ptr<RendererState> state_;
};

}  // namespace figurine::model
