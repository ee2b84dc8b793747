#include "toolchain/capture/camera_rings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "toolchain/error.h"

namespace figurine::capture {
namespace {

constexpr std::array<float, 3> kElevationsDeg = {-9, 13, 36};
constexpr uint32_t kLeftOutNumber = 41;

// Largest |image coordinate| of a point over all cameras, 1 at the border; a point behind a camera
// counts as outside.
float reach(const std::vector<RingCamera>& cameras, const std::vector<Vec3>& points) {
  float worst = 0;
  for (const RingCamera& entry : cameras) {
    const Camera& c = entry.camera;
    const auto& m = c.view_from_world;
    for (const Vec3& p : points) {
      const float z = m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11];
      if (!(z > c.near_m)) return 1e9f;
      const float x = c.fx_px * (m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3]) / z;
      const float y = c.fy_px * (m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7]) / z;
      worst = std::max({worst, std::fabs(x) / c.cx_px, std::fabs(y) / c.cy_px});
    }
  }
  return worst;
}

}  // namespace

std::vector<RingCamera> make_camera_rings(const CameraRingsOptions& options,
                                          const std::vector<Vec3>& points) {
  Vec3 low = points.at(0), high = points.at(0);
  for (const Vec3& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const uint32_t rings = options.views >= 6 ? 3 : 1;
  const auto place = [&](float distance_m) {
    std::vector<RingCamera> cameras;
    for (uint32_t i = 0; i < options.views; ++i) {
      const uint32_t ring = i * rings / options.views;
      const uint32_t first = (ring * options.views + rings - 1) / rings,
                     end = ((ring + 1) * options.views + rings - 1) / rings;
      const float step = 360.0f / static_cast<float>(end - first);
      OrbitCamera orbit;
      orbit.azimuth_deg =
          (static_cast<float>(i - first) + static_cast<float>(ring) / static_cast<float>(rings)) *
          step;
      orbit.elevation_deg = rings == 1 ? kElevationsDeg[1] : kElevationsDeg[ring];
      orbit.distance_m = distance_m;
      orbit.vertical_fov_deg = options.vertical_fov_deg;
      orbit.target_m = {0, (low.y + high.y) / 2, 0};
      RingCamera entry;
      entry.camera =
          value_or_throw(make_orbit_camera(orbit, options.width_px, options.height_px), "--views");
      entry.number = i + 1 < kLeftOutNumber ? i + 1 : i + 2;
      char name[16];
      std::snprintf(name, sizeof name, "C%02u", entry.number);
      entry.name = name;
      cameras.push_back(std::move(entry));
    }
    return cameras;
  };
  float near_m = 0.3f, far_m = 50;
  for (int i = 0; i < 40; ++i) {
    const float middle = (near_m + far_m) / 2;
    (reach(place(middle), points) > 1 - options.margin ? near_m : far_m) = middle;
  }
  return place(far_m);
}

}  // namespace figurine::capture
