#include "samples/common/gaussian_scene.h"

#include <algorithm>
#include <cmath>

#include "ports/gaussians/gaussian_file.h"
#include "ports/host/files.h"
#include "samples/common/camera_matrix.h"

namespace figurine::samples {

namespace {

constexpr float kOpacityThatShows = 0.1f;
constexpr float kSigmas = 3;
constexpr double kMassShare = 0.9;
constexpr float kReach = 3;         // times the distance within which that share lies
constexpr double kMargin = 0.05;    // of the half image, left free on each side
constexpr float kNearShare = 0.1f;  // of the distance

// The rotation that turns the file's up axis into +y.
glm::mat3 upright(const std::string& up) {
  constexpr glm::vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  if (up == "-y") return {x, -y, -z};
  if (up == "+z") return {x, -z, y};
  if (up == "-z") return {x, z, -y};
  if (up == "+x") return {y, -x, z};
  if (up == "-x") return {-y, x, z};
  return {x, y, z};
}

// What is seen of a Gaussian, in upright axes.
struct Extent {
  glm::vec3 centre, half;
};

float value_at(std::vector<float> values, double share) {
  const auto rank =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), rank, values.end());
  return *rank;
}

// Of the Gaussians that can be seen; of all, if none can.
std::vector<Extent> visible_extents(const GaussianCloud& cloud, const glm::mat3& turn) {
  std::vector<Extent> extents;
  const bool any = std::any_of(cloud.opacity.begin(), cloud.opacity.end(),
                               [](float opacity) { return opacity >= kOpacityThatShows; });
  for (uint32_t i = 0; i < cloud.count(); ++i) {
    if (any && !(cloud.opacity[i] >= kOpacityThatShows)) continue;
    const float* factor = &cloud.covariance_factor[9 * size_t(i)];
    glm::vec3 deviation;
    for (int k = 0; k < 3; ++k)
      deviation[k] = std::hypot(factor[3 * k], factor[3 * k + 1], factor[3 * k + 2]);
    extents.push_back({turn * glm::make_vec3(&cloud.position_m[3 * size_t(i)]),
                       glm::abs(turn * (kSigmas * deviation))});  // turn only swaps and turns round
  }
  return extents;
}

// Leaves what is part of the scene: near enough, and none of it further across than the scene.
void keep_the_scene(std::vector<Extent>& extents) {
  if (extents.empty()) return;
  glm::vec3 middle;
  std::vector<float> values(extents.size());
  for (int k = 0; k < 3; ++k) {
    for (size_t i = 0; i < values.size(); ++i) values[i] = extents[i].centre[k];
    middle[k] = value_at(values, 0.5);
  }
  const auto distance = [&](const Extent& extent) {
    const glm::vec3 d = extent.centre - middle;
    return std::hypot(d.x, d.y, d.z);
  };
  for (size_t i = 0; i < values.size(); ++i) values[i] = distance(extents[i]);
  float mass = value_at(values, kMassShare);
  for (size_t i = 0; i < values.size(); ++i) {
    const glm::vec3& half = extents[i].half;
    values[i] = std::max({half.x, half.y, half.z});
  }
  mass = std::max(mass, value_at(values, kMassShare));  // a scene may be in one place
  if (!(mass > 0)) return;
  std::erase_if(extents,
                [&](const Extent& extent) { return !(distance(extent) <= kReach * mass); });
  for (Extent& extent : extents) extent.half = glm::min(extent.half, glm::vec3(mass));
}

}  // namespace

Result<GaussianCloud> read_scene(const std::string& path) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  return ports::read_gaussians(file->bytes(), path);
}

OrbitCamera orbit_scene(const GaussianCloud& cloud, const std::optional<OrbitCamera>& wanted,
                        const std::string& up, ImageSize size) {
  std::vector<Extent> extents = visible_extents(cloud, upright(up));
  keep_the_scene(extents);
  OrbitCamera orbit = wanted.value_or(OrbitCamera{});
  if (extents.empty()) return orbit;
  glm::vec3 low = extents[0].centre, high = low;
  for (const Extent& extent : extents) {
    low = glm::min(low, extent.centre - extent.half);
    high = glm::max(high, extent.centre + extent.half);
  }
  const glm::vec3 target = low + 0.5f * (high - low);
  orbit.target_m = {target.x, target.y, target.z};
  if (wanted) return orbit;
  // From the front the axes of view are x, y and back.
  const double tangent_y = std::tan(glm::radians(0.5 * orbit.vertical_fov_deg)) * (1 - kMargin);
  const double tangent_x = tangent_y * size.width_px / size.height_px;
  double needed = 1e-3;
  for (const Extent& extent : extents) {
    const glm::dvec3 d = glm::abs(extent.centre - target) + extent.half;
    const double towards = extent.centre.z - target.z + extent.half.z;
    needed = std::max(needed, towards + std::max(d.x / tangent_x, d.y / tangent_y));
  }
  orbit.distance_m = static_cast<float>(needed);
  return orbit;
}

Result<Camera> scene_camera(const OrbitCamera& orbit, const std::string& up, ImageSize size) {
  Result<Camera> camera = make_orbit_camera(orbit, size.width_px, size.height_px);
  if (!camera.ok()) return camera;
  set_view_matrix(*camera, view_matrix(*camera) * glm::mat4(upright(up)));
  camera->near_m = std::min(camera->near_m, kNearShare * orbit.distance_m);
  return camera;
}

}  // namespace figurine::samples
