#include "toolchain/pictures/member_pictures.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>

#include "toolchain/error.h"
#include "toolchain/model/parallel.h"
#include "toolchain/train/progress.h"
#include "toolchain/verify/device_avatar.h"

namespace figurine::pictures {

using measure::Picture;

namespace {

constexpr double kOutside =
    0.002;                        // share of the Gaussians on each side that a frame need not hold
constexpr float kDistance_m = 6;  // far enough that perspective does not make faces of different
                                  // people differ by their height
constexpr float kDegrees = 57.29577951308232f;

float quantile_of(std::vector<float>& values, double share) {
  const auto rank =
      static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<size_t>(rank)];
}

// What lifts the person onto the ground y = 0.
float height_above_ground_m(std::span<const float> centres_m) {
  std::vector<float> heights;
  for (size_t i = 1; i < centres_m.size(); i += 3) heights.push_back(centres_m[i]);
  return quantile_of(heights, kOutside);
}

// The shot's camera before it is framed: focal length 1, principal point 0, so that its pixels are
// tangents.
Camera unframed_camera(const Shot& shot, const train::OwnedPose& pose, const Body& body) {
  const std::array<float, 9> root = rotation_from_quaternion(pose.rotations.data());
  const float heading_deg =
      std::atan2(root[2], root[8]) * kDegrees;  // the root's +z axis on the ground
  const OrbitCamera orbit{.azimuth_deg = heading_deg + shot.azimuth_deg,
                          .elevation_deg = shot.elevation_deg,
                          .distance_m = kDistance_m,
                          .target_m = root_position(body.mean_skeleton(), pose.view())};
  Camera camera = value_or_throw(make_orbit_camera(orbit, 2, 2), "camera");
  camera.fx_px = camera.fy_px = 1;
  camera.cx_px = camera.cy_px = 0;
  return camera;
}

Extent extent_of(const Camera& camera, std::span<const float> centres_m, float up_m) {
  std::vector<float> x, y;
  for (size_t i = 0; i + 2 < centres_m.size(); i += 3) {
    const float world[3] = {centres_m[i], centres_m[i + 1] + up_m, centres_m[i + 2]};
    const std::array<float, 3> view = transform_point({camera.view_from_world}, world);
    if (!(view[2] > camera.near_m)) continue;
    x.push_back(view[0] / view[2]);
    y.push_back(view[1] / view[2]);
  }
  if (x.empty()) return {};
  return {quantile_of(x, kOutside), quantile_of(x, 1 - kOutside), quantile_of(y, kOutside),
          quantile_of(y, 1 - kOutside)};
}

}  // namespace

void Extent::add(const Extent& other) {
  left = std::min(left, other.left), right = std::max(right, other.right);
  top = std::min(top, other.top), bottom = std::max(bottom, other.bottom);
}

ShotRenderer::ShotRenderer(const Package& body, std::vector<train::OwnedPose> poses,
                           std::vector<Shot> shots)
    : body_(&body), poses_(std::move(poses)), shots_(std::move(shots)) {
  for (const Shot& shot : shots_)
    cameras_.push_back(unframed_camera(shot, poses_[shot.pose], body.body()));
}

// visit(shot, posed avatar, how far up it is moved); the network runs where the pose changes.
template <class Visit>
void ShotRenderer::each_shot(const Avatar& avatar, size_t first, size_t end, Visit&& visit) const {
  verify::DeviceAvatar device(avatar, *body_);
  for (size_t i = first; i < end; ++i) {
    if (i == first || shots_[i].pose != shots_[i - 1].pose)
      device.pose(poses_[shots_[i].pose].view());
    visit(i, device, shots_[i].grounded ? -height_above_ground_m(device.centres_m()) : 0.0f);
  }
}

std::vector<Extent> ShotRenderer::look(const Avatar& avatar) const {
  std::vector<Extent> extents(shots_.size());
  each_shot(avatar, 0, shots_.size(), [&](size_t shot, verify::DeviceAvatar& device, float up_m) {
    extents[shot] = extent_of(cameras_[shot], device.centres_m(), up_m);
  });
  return extents;
}

void ShotRenderer::frame(size_t shot, const Extent& extent, uint32_t width_px, uint32_t height_px,
                         float margin) {
  const float width = static_cast<float>(width_px), height = static_cast<float>(height_px);
  const float inside = 1 - 2 * margin;
  const float focal_px = std::min(width * inside / (extent.right - extent.left),
                                  height * inside / (extent.bottom - extent.top));
  Camera& camera = cameras_[shot];
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx_px = camera.fy_px = focal_px;
  camera.cx_px = 0.5f * width - focal_px * 0.5f * (extent.left + extent.right);
  camera.cy_px = 0.5f * height - focal_px * 0.5f * (extent.top + extent.bottom);
}

std::vector<Picture> ShotRenderer::draw(const Avatar& avatar, size_t first, size_t end) const {
  std::vector<Picture> pictures;
  each_shot(avatar, first, end, [&](size_t shot, verify::DeviceAvatar& device, float up_m) {
    pictures.push_back(device.draw(cameras_[shot], {0, up_m, 0}));
  });
  return pictures;
}

void Crew::run(const std::string& what, size_t count,
               const std::function<void(size_t)>& piece) const {
  train::Progress progress(what, quiet_);
  std::exception_ptr failure;
  std::mutex mutex;
  const size_t batch =
      2 * size_t(threads_);  // short, so that Ctrl-C and the line are looked at often
  for (size_t first = 0; first < count; first += batch) {
    if (interrupt_.requested())
      throw train::Interrupted(what + ": interrupted; nothing was written");
    progress.show(double(first) / double(count),
                  std::to_string(first) + " of " + std::to_string(count));
    model::parallel_for(threads_, uint32_t(std::min(batch, count - first)), [&](uint32_t i) {
      try {
        piece(first + i);
      } catch (...) {  // none may leave the parallel region
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    });
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace figurine::pictures
