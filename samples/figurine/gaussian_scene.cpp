#include "samples/figurine/gaussian_scene.h"

#include "ports/host/files.h"
#include "samples/common/camera_matrix.h"
#include "samples/common/framing.h"

namespace figurine::samples {

namespace {

// Captured scenes have a subject in the middle and stray Gaussians far out: the picture holds the
// inner nine tenths.
constexpr FramingOptions kSceneFraming{.share = 0.9, .margin = 0.05};
constexpr float kOpacitySeen = 0.1f;

// The rotation that turns the file's up axis into +y.
glm::mat3 upright(const std::string& up) {
  constexpr glm::vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  if (up == "-y") return {x, -y, -z};
  if (up == "+z") return {x, -z, y};
  if (up == "-z") return {x, z, -y};
  return {x, y, z};
}

}  // namespace

Result<GaussianCloud> read_scene(const std::string& path) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<GaussianCloud> cloud = ports::read_gaussian_ply(file->bytes(), path);
  if (cloud.ok() && cloud->count() == 0)
    return Status(StatusCode::kInvalidArgument,
                  path + ": ply: holds no Gaussian that can be drawn");
  return cloud;
}

OrbitCamera orbit_scene(const GaussianCloud& cloud, const std::optional<OrbitCamera>& wanted,
                        const std::string& up, ImageSize size) {
  const glm::mat3 turn = upright(up);
  std::vector<Point> points;
  for (uint32_t i = 0; i < cloud.count(); ++i) {
    if (!(cloud.opacity[i] >= kOpacitySeen)) continue;
    const float* p = &cloud.position_m[3 * size_t(i)];
    const glm::vec3 point = turn * glm::make_vec3(p);
    points.push_back({point.x, point.y, point.z});
  }
  OrbitCamera orbit = wanted.value_or(OrbitCamera{.azimuth_deg = 25, .elevation_deg = 12});
  orbit.target_m = robust_centre(points, kSceneFraming.share);
  if (!wanted)
    orbit.distance_m = fit_distance_m(
        points, orbit, static_cast<double>(size.width_px) / size.height_px, kSceneFraming);
  return orbit;
}

Result<Camera> scene_camera(const OrbitCamera& orbit, const std::string& up, ImageSize size) {
  Result<Camera> camera = make_orbit_camera(orbit, size.width_px, size.height_px);
  if (!camera.ok()) return camera;
  set_view_matrix(*camera, view_matrix(*camera) * glm::mat4(upright(up)));
  return camera;
}

}  // namespace figurine::samples
