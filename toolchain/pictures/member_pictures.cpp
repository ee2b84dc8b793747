#include "toolchain/pictures/member_pictures.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>

#include "figurine/check.h"
#include "toolchain/error.h"
#include "toolchain/measure/body_parts.h"
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

// The middle of a coordinate's range (0, 1 or 2) but for what lies farthest out.
float middle_m(std::span<const float> centres_m, size_t coordinate) {
  std::vector<float> values;
  for (size_t i = coordinate; i < centres_m.size(); i += 3) values.push_back(centres_m[i]);
  const float low = quantile_of(values, kOutside);
  return 0.5f * (low + quantile_of(values, 1 - kOutside));
}

// What lifts the person onto the ground y = 0.
float height_above_ground_m(std::span<const float> centres_m) {
  std::vector<float> heights;
  for (size_t i = 1; i < centres_m.size(); i += 3) heights.push_back(centres_m[i]);
  return quantile_of(heights, kOutside);
}

constexpr std::array<float, 3> kBustPlace_m{0, 1.5f, 0};  // where every bust is moved to

// Where a joint's +z axis points on the ground, as an azimuth.
float heading_deg(const Body& body, const train::OwnedPose& pose, int joint) {
  std::array<float, 3> forward{0, 0, 1};
  for (; joint >= 0; joint = body.parents[static_cast<size_t>(joint)]) {
    const std::array<float, 9> r =
        rotation_from_quaternion(&pose.rotations[static_cast<size_t>(joint) * 4]);
    forward = {r[0] * forward[0] + r[1] * forward[1] + r[2] * forward[2],
               r[3] * forward[0] + r[4] * forward[1] + r[5] * forward[2],
               r[6] * forward[0] + r[7] * forward[1] + r[8] * forward[2]};
  }
  return std::atan2(forward[0], forward[2]) * kDegrees;
}

// The shot's camera before it is framed: focal length 1, principal point 0, so that its pixels are
// tangents.
Camera unframed_camera(const Shot& shot, const train::OwnedPose& pose, const Body& body) {
  const bool bust = shot.subject == Subject::kBust;
  const auto head = std::ranges::find(body.joint_names, "head") - body.joint_names.begin();
  const OrbitCamera orbit{
      .azimuth_deg = heading_deg(body, pose, bust ? static_cast<int>(head) : 0) + shot.azimuth_deg,
      .elevation_deg = shot.elevation_deg,
      .distance_m = kDistance_m,
      .target_m = bust ? kBustPlace_m : root_position(body.mean_skeleton(), pose.view())};
  Camera camera = value_or_throw(make_orbit_camera(orbit, 2, 2), "camera");
  camera.fx_px = camera.fy_px = 1;
  camera.cx_px = camera.cy_px = 0;
  return camera;
}

std::vector<float> rows_of(std::span<const float> centres_m, std::span<const uint32_t> texels) {
  std::vector<float> rows;
  for (const uint32_t texel : texels) {
    for (size_t k = 0; k < 3; ++k) rows.push_back(centres_m[size_t{3} * texel + k]);
  }
  return rows;
}

Extent extent_of(const Camera& camera, std::span<const float> centres_m,
                 const std::array<float, 3>& displacement_m) {
  std::vector<float> x, y;
  for (size_t i = 0; i + 2 < centres_m.size(); i += 3) {
    const float world[3] = {centres_m[i] + displacement_m[0], centres_m[i + 1] + displacement_m[1],
                            centres_m[i + 2] + displacement_m[2]};
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
    : body_(&body),
      bust_(measure::bust_texels(body.body())),
      poses_(std::move(poses)),
      shots_(std::move(shots)) {
  const bool busts = std::ranges::find(shots_, Subject::kBust, &Shot::subject) != shots_.end();
  FIG_CHECK(!busts || !bust_.empty(), "a body with a head");
  for (const Shot& shot : shots_)
    cameras_.push_back(unframed_camera(shot, poses_[shot.pose], body.body()));
}

std::array<float, 3> ShotRenderer::displacement_m(const Shot& shot,
                                                  std::span<const float> centres_m) const {
  if (shot.subject == Subject::kPlaced) return {0, 0, 0};
  if (shot.subject == Subject::kGrounded) return {0, -height_above_ground_m(centres_m), 0};
  const std::vector<float> bust = rows_of(centres_m, bust_);
  std::array<float, 3> moved = kBustPlace_m;
  for (size_t k = 0; k < 3; ++k) moved[k] -= middle_m(bust, k);
  return moved;
}

// visit(shot, posed avatar, how far it is moved); the network runs where the pose changes.
template <class Visit>
void ShotRenderer::each_shot(const Avatar& avatar, size_t first, size_t end, Visit&& visit) const {
  verify::DeviceAvatar device(avatar, *body_);
  for (size_t i = first; i < end; ++i) {
    if (i == first || shots_[i].pose != shots_[i - 1].pose)
      device.pose(poses_[shots_[i].pose].view());
    visit(i, device, displacement_m(shots_[i], device.centres_m()));
  }
}

std::vector<Extent> ShotRenderer::look(const Avatar& avatar) const {
  std::vector<Extent> extents(shots_.size());
  each_shot(avatar, 0, shots_.size(),
            [&](size_t shot, verify::DeviceAvatar& device, const std::array<float, 3>& moved_m) {
              const std::span<const float> centres_m = device.centres_m();
              extents[shot] = shots_[shot].subject == Subject::kBust
                                  ? extent_of(cameras_[shot], rows_of(centres_m, bust_), moved_m)
                                  : extent_of(cameras_[shot], centres_m, moved_m);
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
  each_shot(avatar, first, end,
            [&](size_t shot, verify::DeviceAvatar& device, const std::array<float, 3>& moved_m) {
              pictures.push_back(device.draw(cameras_[shot], moved_m));
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
