#include "samples/common/camera_path.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace figurine::samples {

namespace {

constexpr double kRadians = 3.14159265358979323846 / 180;
constexpr size_t kFramingFrames = 5;  // posed to see how large the figures are
// Of body, bust and head: smoothing of the followed path, about a step; heads leave a close-up
// sooner.
constexpr std::array<double, 3> kFollowSigma_s{0.4, 0.2, 0.2};
constexpr float kOpacitySeen =
    0.05f;  // fainter Gaussians do not decide what must be in the picture
constexpr size_t kTurntableViews = 8;   // looked at for a distance from which all fit
constexpr float kDefaultTurn_deg = 25;  // a three-quarter view shows more shape than a frontal one
// Of body, bust and head. Close-ups are level with the eyes, and from as far as somebody across a
// table: nearer, a nose grows.
constexpr std::array<float, 3> kDefaultElevation_deg{6, 0, 0};
constexpr std::array<float, 3> kDefaultFov_deg{35, 25, 20};

// Of view i of count that go round once.
float turn_deg(size_t i, size_t count) {
  return 360 * static_cast<float>(i) / static_cast<float>(count);
}

// What is followed: in each frame the mean place of everybody's root joint on the ground, or of
// everybody's head.
std::vector<Point> figures_path(std::span<const uint32_t> frames, Framing framing, Scene& scene) {
  std::vector<Point> path;
  for (const uint32_t frame : frames) {
    scene.pose(frame);
    Point mean{0, 0, 0};
    for (size_t m = 0; m < scene.size(); ++m) {
      Point place = scene.root_m(m);
      if (framing == Framing::kBody) {
        place[1] = 0;
      } else {  // framed_joints: the head is the first, and there
        place = scene.joint_m(m, framed_joints(scene.body(m).package.body(), framing)->front());
      }
      for (size_t k = 0; k < 3; ++k) mean[k] += place[k] / static_cast<float>(scene.size());
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

// Which of a figure's Gaussians, one a texel, belong to what is framed.
std::vector<bool> framed_texels(const Body& body, Framing framing) {
  std::vector<bool> framed(body.texel_count(), true);
  if (framing == Framing::kBody) return framed;
  const std::vector<uint8_t> joints = *framed_joints(body, framing);
  for (uint32_t i = 0; i < body.texel_count(); ++i) framed[i] = moved_most_by(body, i, joints);
  return framed;
}

// Centres of the framed Gaussians that can be seen in a few of the frames, relative to path.
Result<std::vector<Point>> sample_points(std::span<const uint32_t> frames,
                                         std::span<const Point> path, Framing framing, Scene& scene,
                                         Renderer& renderer) {
  std::vector<std::vector<bool>> framed;  // of each figure
  for (size_t m = 0; m < scene.size(); ++m)
    framed.push_back(framed_texels(scene.body(m).package.body(), framing));
  std::vector<Point> points;
  const size_t samples = std::min(kFramingFrames, frames.size());
  for (size_t s = 0; s < samples; ++s) {
    const size_t at = samples == 1 ? 0 : s * (frames.size() - 1) / (samples - 1);
    const std::span<const FrameAvatar> posed = scene.pose(frames[at]);
    for (size_t m = 0; m < posed.size(); ++m) {
      const Result<GaussianView> gaussians = renderer.pose_avatar(posed[m].avatar, posed[m].pose);
      if (!gaussians.ok()) return gaussians.status();
      for (uint32_t i = 0; i < gaussians->count; ++i) {
        if (!framed[m][i] || !(gaussians->opacity[i] >= kOpacitySeen)) continue;
        const float* p = &gaussians->position_m[3 * size_t(i)];
        points.push_back({p[0] - path[at][0], p[1] - path[at][1], p[2] - path[at][2]});
      }
    }
  }
  return points;
}

// The camera that the options name, at the size asked for.
Result<Camera> camera_of_file(const CameraPathOptions& options, const Camera& golden) {
  if (options.framing != Framing::kBody) {
    return Status(StatusCode::kInvalidArgument,
                  "framing: a camera from a file frames by itself; give one or the other");
  }
  Result<Camera> sized =
      fixed_camera(*options.camera.fixed, options.size, {golden.width_px, golden.height_px});
  if (!sized.ok()) return sized;
  if (options.near_m) sized->near_m = *options.near_m;
  FIG_RETURN_IF_ERROR(validate_camera(*sized));
  return sized;
}

}  // namespace

Result<FramedOrbit> frame_figures(const CameraPathOptions& options,
                                  std::span<const uint32_t> frames, Scene& scene,
                                  Renderer& renderer) {
  FIG_CHECK(!options.camera.fixed, "a camera of a file frames by itself");
  const Camera& golden = scene.avatar(0).avatar.golden.camera;
  if (options.framing != Framing::kBody) {
    for (size_t m = 0; m < scene.size(); ++m) {
      const Result<std::vector<uint8_t>> joints =
          framed_joints(scene.body(m).package.body(), options.framing);
      if (!joints.ok()) return joints.status();
    }
  }
  const ImageSize size = options.size.value_or(ImageSize{golden.width_px, golden.height_px});
  const double aspect = static_cast<double>(size.width_px) / size.height_px;
  // An orbit that stays sees the path in world coordinates.
  FramedOrbit framed{options.camera.orbit.value_or(OrbitCamera{}),
                     std::vector<Point>(frames.size(), {0, 0, 0})};
  if (options.follow) {
    const double rate = options.frames_per_second.value_or(
        scene.frames_per_second() / (frames.size() > 1 ? frames[1] - frames[0] : 1));
    framed.path = smooth_path(figures_path(frames, options.framing, scene),
                              kFollowSigma_s[static_cast<size_t>(options.framing)] * rate);
  }
  const Result<std::vector<Point>> points =
      sample_points(frames, framed.path, options.framing, scene, renderer);
  if (!points.ok()) return points.status();

  FramingOptions framing;
  const Point centre = robust_centre(*points, framing.share);
  OrbitCamera& orbit = framed.orbit;
  // Whole figures turn about their root; a face is where it is.
  const bool about_root = options.follow && options.framing == Framing::kBody;
  orbit.target_m = about_root ? Point{0, centre[1], 0} : centre;
  if (options.camera.orbit) return framed;
  scene.pose(frames[0]);
  orbit.azimuth_deg = mean_heading_deg(scene) + kDefaultTurn_deg;
  orbit.elevation_deg = kDefaultElevation_deg[static_cast<size_t>(options.framing)];
  orbit.vertical_fov_deg = kDefaultFov_deg[static_cast<size_t>(options.framing)];
  orbit.distance_m = fit_distance_m(*points, orbit, aspect, framing);
  for (size_t i = 1; options.turntable && i < kTurntableViews; ++i) {
    OrbitCamera turned = orbit;
    turned.azimuth_deg += turn_deg(i, kTurntableViews);
    orbit.distance_m = std::max(orbit.distance_m, fit_distance_m(*points, turned, aspect, framing));
  }
  return framed;
}

Result<std::vector<Camera>> make_camera_path(const CameraPathOptions& options,
                                             std::span<const uint32_t> frames, Scene& scene,
                                             Renderer& renderer) {
  const Camera& golden = scene.avatar(0).avatar.golden.camera;
  if (options.camera.fixed) {
    if (options.turntable) {
      return Status(StatusCode::kInvalidArgument,
                    "turntable: a camera from a file stays where it is; give one or the other");
    }
    const Result<Camera> camera = camera_of_file(options, golden);
    if (!camera.ok()) return camera.status();
    return std::vector<Camera>(frames.size(), *camera);
  }
  const Result<FramedOrbit> framed = frame_figures(options, frames, scene, renderer);
  if (!framed.ok()) return framed.status();
  const ImageSize size = options.size.value_or(ImageSize{golden.width_px, golden.height_px});
  std::vector<Camera> cameras;
  for (size_t i = 0; i < frames.size(); ++i) {
    OrbitCamera here = framed->orbit;
    if (options.turntable) here.azimuth_deg += turn_deg(i, frames.size());
    for (size_t k = 0; k < 3; ++k) here.target_m[k] += framed->path[i][k];
    Result<Camera> camera = make_orbit_camera(here, size.width_px, size.height_px);
    if (!camera.ok()) return camera.status();
    if (options.near_m) camera->near_m = *options.near_m;
    FIG_RETURN_IF_ERROR(validate_camera(*camera));
    cameras.push_back(*camera);
  }
  return cameras;
}

}  // namespace figurine::samples
