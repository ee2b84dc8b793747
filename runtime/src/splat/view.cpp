#include "runtime/src/splat/view.h"

#include <algorithm>

#include "figurine/gaussian.h"

namespace figurine {

kernels::View make_view(const Camera& camera, float alpha_cut) {
  kernels::View view;
  const std::array<float, 12>& m = camera.view_from_world;
  std::copy(m.begin(), m.end(), view.view_from_world);
  for (size_t k = 0; k < 3; ++k) {
    const double centre = -(double(m[k]) * double(m[3]) + double(m[4 + k]) * double(m[7]) +
                            double(m[8 + k]) * double(m[11]));
    view.camera_centre_m[k] = static_cast<float>(centre);
  }
  view.fx_px = camera.fx_px;
  view.fy_px = camera.fy_px;
  view.cx_px = camera.cx_px;
  view.cy_px = camera.cy_px;
  view.near_m = camera.near_m;
  view.width_px = camera.width_px;
  view.height_px = camera.height_px;
  // The image's own range widened by 0.15 of a side on each side: for a centred principal point the
  // original's 1.3 tan(fov / 2).
  constexpr float kMargin = 0.5f * (kFrustumClamp - 1.0f);
  const float width = static_cast<float>(camera.width_px),
              height = static_cast<float>(camera.height_px);
  view.tan_x_min = -(camera.cx_px + kMargin * width) / camera.fx_px;
  view.tan_x_max = (width - camera.cx_px + kMargin * width) / camera.fx_px;
  view.tan_y_min = -(camera.cy_px + kMargin * height) / camera.fy_px;
  view.tan_y_max = (height - camera.cy_px + kMargin * height) / camera.fy_px;
  view.alpha_cut = alpha_cut;
  return view;
}

}  // namespace figurine
