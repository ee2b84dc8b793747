#include "toolchain/capture/camera_rings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "toolchain/error.h"

namespace figurine::capture {
namespace {

constexpr std::array<float, 3> kElevationsDeg = {-9, 13, 36};
// Below: a laptop on a table; above: a screen on a wall.
constexpr std::array<float, 2> kBustElevationsDeg = {-6, 12};
constexpr double kBustShare = 0.98;
constexpr uint32_t kLeftOutNumber = 41;

// The share of the points that are inside the images but for the margin, over all cameras; a point
// behind a camera counts as outside.
double share_inside(const std::vector<Camera>& cameras, const std::vector<Vec3>& points,
                    float margin) {
  size_t inside = 0;
  for (const Camera& c : cameras) {
    const auto& m = c.view_from_world;
    for (const Vec3& p : points) {
      const float z = m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11];
      if (!(z > c.near_m)) continue;
      const float x = c.fx_px * (m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3]) / z;
      const float y = c.fy_px * (m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7]) / z;
      inside += std::max(std::fabs(x) / c.cx_px, std::fabs(y) / c.cy_px) <= 1 - margin;
    }
  }
  return static_cast<double>(inside) / static_cast<double>(cameras.size() * points.size());
}

// Directions on rings, seen from the middle.
std::vector<OrbitCamera> body_orbits(uint32_t views) {
  const uint32_t rings = views >= 6 ? 3 : 1;
  std::vector<OrbitCamera> orbits;
  for (uint32_t i = 0; i < views; ++i) {
    const uint32_t ring = i * rings / views;
    const uint32_t first = (ring * views + rings - 1) / rings,
                   end = ((ring + 1) * views + rings - 1) / rings;
    const float step = 360.0f / static_cast<float>(end - first);
    OrbitCamera& orbit = orbits.emplace_back();
    orbit.azimuth_deg =
        (static_cast<float>(i - first) + static_cast<float>(ring) / static_cast<float>(rings)) *
        step;
    orbit.elevation_deg = rings == 1 ? kElevationsDeg[1] : kElevationsDeg[ring];
  }
  return orbits;
}

std::vector<OrbitCamera> bust_orbits(uint32_t views) {
  std::vector<OrbitCamera> orbits(views);
  for (uint32_t i = 0; i < views; ++i) {
    orbits[i].azimuth_deg = 360.0f * static_cast<float>(i) / static_cast<float>(views);
    orbits[i].elevation_deg = kBustElevationsDeg[i % kBustElevationsDeg.size()];
  }
  return orbits;
}

// All at one distance from a point on the axis: the nearest at which the share of points is inside
// the images with the margin.
std::vector<Camera> place(std::vector<OrbitCamera> orbits, const CameraRingsOptions& options,
                          float target_height_m, const std::vector<Vec3>& points, double share) {
  const auto at = [&](float distance_m) {
    std::vector<Camera> cameras;
    for (OrbitCamera& orbit : orbits) {
      orbit.distance_m = distance_m;
      orbit.vertical_fov_deg = options.vertical_fov_deg;
      orbit.target_m = {0, target_height_m, 0};
      cameras.push_back(
          value_or_throw(make_orbit_camera(orbit, options.width_px, options.height_px), "--views"));
    }
    return cameras;
  };
  float near_m = 0.3f, far_m = 50;
  for (int i = 0; i < 40; ++i) {
    const float middle = (near_m + far_m) / 2;
    (share_inside(at(middle), points, options.margin) < share ? near_m : far_m) = middle;
  }
  return at(far_m);
}

// The same picture with sides of another size, whole pixels.
Camera scaled(Camera camera, float scale) {
  const auto side = [&](uint32_t& size_px) {
    const float before = static_cast<float>(size_px);
    size_px = static_cast<uint32_t>(std::max(1.0f, std::round(before * scale)));
    return static_cast<float>(size_px) / before;
  };
  const float x = side(camera.width_px), y = side(camera.height_px);
  camera.fx_px *= x, camera.cx_px *= x;
  camera.fy_px *= y, camera.cy_px *= y;
  return camera;
}

// Behind the cameras that are there already, numbered on.
void append(std::vector<RingCamera>& rings, const std::vector<Camera>& cameras,
            dataset::Framing framing) {
  for (const Camera& camera : cameras) {
    const auto count = static_cast<uint32_t>(rings.size()) + 1;
    RingCamera& entry = rings.emplace_back();
    entry.camera = camera;
    entry.framing = framing;
    entry.number = count < kLeftOutNumber ? count : count + 1;
    char name[16];
    std::snprintf(name, sizeof name, "%c%02u", framing == dataset::Framing::kBody ? 'C' : 'B',
                  entry.number);
    entry.name = name;
  }
}

// The middle of the narrowest band of heights that holds the share of the points.
float middle_height(const std::vector<Vec3>& points, double share) {
  std::vector<float> heights;
  for (const Vec3& p : points) heights.push_back(p.y);
  std::sort(heights.begin(), heights.end());
  const auto held = static_cast<size_t>(std::ceil(share * double(heights.size())));
  size_t best = 0;
  for (size_t i = 0; i + held <= heights.size(); ++i) {
    if (heights[i + held - 1] - heights[i] < heights[best + held - 1] - heights[best]) best = i;
  }
  return (heights[best] + heights[best + held - 1]) / 2;
}

}  // namespace

std::vector<RingCamera> make_camera_rings(const CameraRingsOptions& options,
                                          const std::vector<Vec3>& points,
                                          const std::vector<Vec3>& bust_points) {
  std::vector<RingCamera> rings;
  append(rings, place(body_orbits(options.views), options, middle_height(points, 1), points, 1),
         dataset::Framing::kBody);
  if (options.bust_views > 0) {
    std::vector<Camera> cameras =
        place(bust_orbits(options.bust_views), options, middle_height(bust_points, kBustShare),
              bust_points, kBustShare);
    for (Camera& camera : cameras) camera = scaled(camera, options.bust_scale);
    append(rings, cameras, dataset::Framing::kBust);
  }
  return rings;
}

}  // namespace figurine::capture
