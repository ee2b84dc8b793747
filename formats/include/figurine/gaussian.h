// What a 3D Gaussian is, and the constants of its splatting (docs/numerics.md, "Splatting").
//
// Follows the original rasterizer's semantics (Kerbl et al., 3D Gaussian Splatting for Real-Time
// Radiance Field Rendering, 2023) with one difference that makes the picture independent of tile
// size: a Gaussian touches a pixel exactly where alpha >= the alpha cut, instead of inside the
// tiles that a circle of 3 sigma touches.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace figurine {

inline constexpr uint32_t kMaxShDegree = 3;
constexpr uint32_t sh_coefficients(uint32_t degree) { return (degree + 1) * (degree + 1); }

// Real spherical harmonics in the sign convention of the original 3DGS.
inline constexpr float kSh0 = 0.28209479177387814f;
inline constexpr float kSh1 = 0.4886025119029199f;
inline constexpr std::array<float, 5> kSh2{1.0925484305920792f, -1.0925484305920792f,
                                           0.31539156525252005f, -1.0925484305920792f,
                                           0.5462742152960396f};
inline constexpr std::array<float, 7> kSh3{
    -0.5900435899266435f, 2.890611442640554f, -0.4570457994644658f, 0.3731763325901154f,
    -0.4570457994644658f, 1.445305721320277f, -0.5900435899266435f};
inline constexpr float kShOffset = 0.5f;  // colour = max(SH(direction) + 0.5, 0), direction =
                                          // normalise(centre - camera centre) in world axes

inline constexpr float kDilationPx2 = 0.3f;  // added to the diagonal of the 2D covariance
inline constexpr float kAntialiasedDilationPx2 =
    0.1f;  // the same where splats are antialiased: about a pixel's own area
inline constexpr float kAlphaCut = 1.0f / 255.0f;  // contributions with alpha below it are skipped
inline constexpr float kAlphaMax = 0.99f;
inline constexpr float kTransmittanceStop =
    1e-4f;  // a pixel stops before the contribution that would take T below it
// x/z and y/z in the Jacobian are clamped to the image's own range, widened on either side by (1.3
// - 1) / 2 of its size: for a centred principal point this is the original's 1.3 tan(fov/2).
inline constexpr float kFrustumClamp = 1.3f;

// Gaussians in world space, borrowed arrays of length n. The covariance is F F^T for the factor F =
// A R S, so that determinants can be formed from minors without cancellation.
struct GaussianView {
  uint32_t count = 0;
  uint32_t sh_degree = 0;
  std::span<const float> position_m;         // [n,3]
  std::span<const float> covariance_factor;  // [n,9] row-major F
  std::span<const float> opacity;            // [n] in [0,1]
  std::span<const float> sh;                 // [n,(d+1)^2,3] coefficient-major, RGB innermost
};

}  // namespace figurine
