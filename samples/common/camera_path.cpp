#include "samples/common/camera_path.h"

#include <algorithm>
#include <cmath>

#include "samples/common/framing.h"

namespace figurine::samples {

namespace {

constexpr double kRadians = 3.14159265358979323846 / 180;
constexpr size_t kFramingFrames = 5;    // posed to see how large the figures are
constexpr double kFollowSigma_s = 0.4;  // smoothing of the followed path: about a step
constexpr float kOpacitySeen =
    0.05f;  // fainter Gaussians do not decide what must be in the picture
constexpr float kDefaultTurn_deg = 25;  // a three-quarter view shows more shape than a frontal one
constexpr float kDefaultElevation_deg = 6;
constexpr float kDefaultFov_deg = 35;

// Mean ground position of everybody in each frame.
std::vector<std::array<float, 2>> ground_path(std::span<const uint32_t> frames, Scene& scene) {
  std::vector<std::array<float, 2>> path;
  for (const uint32_t frame : frames) {
    scene.pose(frame);
    std::array<float, 2> mean{0, 0};
    for (size_t m = 0; m < scene.size(); ++m) {
      mean[0] += scene.root_m(m)[0] / static_cast<float>(scene.size());
      mean[1] += scene.root_m(m)[2] / static_cast<float>(scene.size());
    }
    path.push_back(mean);
  }
  return path;
}

// The direction in which most of the figures look.
float mean_heading_deg(const Scene& scene) {
  double x = 0, z = 0;
  for (size_t m = 0; m < scene.size(); ++m) {
    x += std::sin(scene.heading_deg(m) * kRadians);
    z += std::cos(scene.heading_deg(m) * kRadians);
  }
  return static_cast<float>(std::atan2(x, z) / kRadians);
}

// Centres of the Gaussians that can be seen in a few of the frames, relative to path.
Result<std::vector<Point>> sample_points(std::span<const uint32_t> frames,
                                         std::span<const std::array<float, 2>> path, Scene& scene,
                                         Renderer& renderer) {
  std::vector<Point> points;
  const size_t samples = std::min(kFramingFrames, frames.size());
  for (size_t s = 0; s < samples; ++s) {
    const size_t at = samples == 1 ? 0 : s * (frames.size() - 1) / (samples - 1);
    for (const FrameAvatar& member : scene.pose(frames[at])) {
      const Result<GaussianView> gaussians = renderer.pose_avatar(member.avatar, member.pose);
      if (!gaussians.ok()) return gaussians.status();
      for (uint32_t i = 0; i < gaussians->count; ++i) {
        if (!(gaussians->opacity[i] >= kOpacitySeen)) continue;
        const float* p = &gaussians->position_m[3 * size_t(i)];
        points.push_back({p[0] - path[at][0], p[1], p[2] - path[at][1]});
      }
    }
  }
  return points;
}

}  // namespace

Result<std::vector<Camera>> make_camera_path(const CameraPathOptions& options,
                                             std::span<const uint32_t> frames, Scene& scene,
                                             Renderer& renderer) {
  const Camera& golden = scene.avatar(0).avatar.golden.camera;
  if (options.camera.fixed) {
    Camera camera = *options.camera.fixed;
    ImageSize size{camera.width_px, camera.height_px};
    if (size.width_px == 0) size = {golden.width_px, golden.height_px};
    Result<Camera> sized = resize_camera(camera, options.size.value_or(size));
    if (!sized.ok()) return sized.status();
    if (options.near_m) sized->near_m = *options.near_m;
    FIG_RETURN_IF_ERROR(validate_camera(*sized));
    return std::vector<Camera>(frames.size(), *sized);
  }
  const ImageSize size = options.size.value_or(ImageSize{golden.width_px, golden.height_px});
  const double aspect = static_cast<double>(size.width_px) / size.height_px;
  std::vector<std::array<float, 2>> path(
      frames.size(), {0, 0});  // an orbit that stays sees the path in world coordinates
  if (options.follow)
    path = smooth_path(ground_path(frames, scene),
                       kFollowSigma_s * scene.frames_per_second() /
                           (frames.size() > 1 ? frames[1] - frames[0] : 1));
  const Result<std::vector<Point>> points = sample_points(frames, path, scene, renderer);
  if (!points.ok()) return points.status();

  FramingOptions framing;
  const Point centre = robust_centre(*points, framing.share);
  OrbitCamera orbit = options.camera.orbit.value_or(OrbitCamera{});
  orbit.target_m = options.follow ? Point{0, centre[1], 0} : centre;
  if (!options.camera.orbit) {
    scene.pose(frames[0]);
    orbit.azimuth_deg = mean_heading_deg(scene) + kDefaultTurn_deg;
    orbit.elevation_deg = kDefaultElevation_deg;
    orbit.vertical_fov_deg = kDefaultFov_deg;
    orbit.distance_m = fit_distance_m(*points, orbit, aspect, framing);
  }
  std::vector<Camera> cameras;
  for (size_t i = 0; i < frames.size(); ++i) {
    OrbitCamera here = orbit;
    here.target_m[0] += path[i][0];
    here.target_m[2] += path[i][1];
    Result<Camera> camera = make_orbit_camera(here, size.width_px, size.height_px);
    if (!camera.ok()) return camera.status();
    if (options.near_m) camera->near_m = *options.near_m;
    FIG_RETURN_IF_ERROR(validate_camera(*camera));
    cameras.push_back(*camera);
  }
  return cameras;
}

}  // namespace figurine::samples
