// A differentiable splatter on the CPU: Gaussians to premultiplied RGBA of a crop rectangle, and
// the analytic gradient back to every parameter.
//
// Semantics are those of figurine/gaussian.h and docs/numerics.md, "Splatting"; tests hold it
// against tests/oracle/splat_oracle.h. Instantiated for float (training) and double
// (finite-difference checks). Does not decode network outputs (head.h) and knows no LibTorch
// (render.h).
//
// Idea: one depth sort, a stable counting bin into tiles of 32x32 pixels, and per (Gaussian, tile)
// a 64-bit mask of the 4x4 pixel blocks that the ellipse alpha >= cut touches. Pixels of a block
// are the lanes of a vector. The backward pass walks every tile front to back again: with B = sum
// over later contributions of (gradient . their share), which the forward image gives without
// storing anything per contribution, dL/dalpha = T (g . colour) - B / (1 - alpha). Each (Gaussian,
// tile) pair has its own nine sums, added up per Gaussian in a fixed order. Based on: Kerbl et al.,
// 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023; Zwicker et al., EWA
// Splatting, 2002.
#pragma once

#include <cstdint>
#include <memory>

#include "figurine/camera.h"
#include "figurine/gaussian.h"

namespace figurine::model {

// Pixels [x, x + width) x [y, y + height) of the camera's image.
struct PixelRect {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};

// World-space Gaussians, borrowed arrays; shapes as in GaussianView.
template <class Scalar>
struct GaussianArrays {
  uint32_t count = 0;
  uint32_t sh_degree = 0;
  const Scalar* position_m = nullptr;         // [n,3]
  const Scalar* covariance_factor = nullptr;  // [n,9] row-major F, covariance F F^T
  const Scalar* opacity = nullptr;            // [n] in [0,1]
  const Scalar* sh = nullptr;                 // [n,(d+1)^2,3]
};

// dL/d of the arrays above, same shapes; overwritten, not added to.
template <class Scalar>
struct GaussianGradients {
  Scalar* position_m = nullptr;
  Scalar* covariance_factor = nullptr;
  Scalar* opacity = nullptr;
  Scalar* sh = nullptr;
};

struct SplatterOptions {
  uint32_t threads = 1;
  float alpha_cut = kAlphaCut;
  bool antialiased = false;  // as the runtime's SplatOptions::antialiased
};

struct SplatterStatistics {
  uint64_t visible = 0;  // Gaussians that touch the crop
  uint64_t pairs = 0;    // (Gaussian, tile)
  uint64_t blocks = 0;   // (Gaussian, 4x4 block) evaluations of the forward pass
};

template <class Scalar>
class Splatter {
 public:
  explicit Splatter(const SplatterOptions& options);
  ~Splatter();
  Splatter(Splatter&&) noexcept;

  // image: [4, crop.height, crop.width] planes R, G, B (premultiplied) and alpha = 1 - T. The crop
  // must lie within the camera's image. Gaussians that are not finite are left out. The same input
  // gives the same image for any number of threads.
  void forward(const GaussianArrays<Scalar>& gaussians, const Camera& camera, const PixelRect& crop,
               Scalar* image);

  // Gradients of the last forward(), whose arrays and image must still be there unchanged.
  // image_gradient: dL/dimage, same shape as the image. Gaussians that were left out or culled get
  // zeros. The same input gives the same gradients for any number of threads.
  void backward(const Scalar* image, const Scalar* image_gradient,
                const GaussianGradients<Scalar>& gradients);

  const SplatterStatistics& statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Splatter<float>;
extern template class Splatter<double>;

}  // namespace figurine::model
