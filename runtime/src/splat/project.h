// World-space Gaussians to image-space splats: cull, project, evaluate the colour seen from the
// camera. One Gaussian at a time, no memory of its own.
//
// Based on: Zwicker et al., EWA Splatting, 2002, eq. 26-31 (the Jacobian of the perspective map),
// in the form of docs/numerics.md, "Splatting".
#pragma once

#include <array>
#include <cstdint>

#include "figurine/camera.h"
#include "figurine/gaussian.h"
#include "runtime/src/splat/kernels/blend.h"

namespace figurine {

// What projection needs of a camera, computed once a frame.
struct ViewParameters {
  std::array<float, 12> view_from_world;
  std::array<float, 3> camera_centre_m;
  float fx_px, fy_px, cx_px, cy_px, near_m;
  float tan_x_min, tan_x_max, tan_y_min, tan_y_max;  // range of x/z and y/z in the Jacobian
  uint32_t width_px, height_px;
  float alpha_cut;
};

ViewParameters make_view_parameters(const Camera& camera, float alpha_cut);

// Tiles that a splat's box touches, ends included, and where along y its ellipse is widest to the
// right: dy of that point.
struct SplatBox {
  uint16_t tile_x_begin, tile_y_begin, tile_x_last, tile_y_last;
  float widest_dy_px;
};

// False if the Gaussian is left out: behind the near plane, outside the image, below the cut, or
// not finite. Then nothing is promised of the outputs.
bool project_gaussian(const ViewParameters& view, const GaussianView& gaussians, uint32_t index,
                      kernels::Splat& splat, SplatBox& box, float& depth_m);

// max(SH(direction) + 0.5, 0) per channel; direction is unit length. False if the sum is not
// finite.
bool evaluate_colour(const float* sh, uint32_t degree, const std::array<float, 3>& direction,
                     float* rgb);

}  // namespace figurine
