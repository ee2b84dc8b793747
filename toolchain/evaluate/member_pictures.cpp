#include "toolchain/evaluate/member_pictures.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>

#include "figurine/check.h"
#include "toolchain/error.h"
#include "toolchain/evaluate/widest_vectors.h"
#include "toolchain/model/parallel.h"
#include "toolchain/train/progress.h"
#include "toolchain/verify/device_avatar.h"

namespace figurine::evaluate {

namespace {

constexpr double kOutside =
    0.002;                        // share of the Gaussians on each side that a frame need not hold
constexpr float kDistance_m = 6;  // far enough that perspective does not make faces of different
                                  // people differ by their height
constexpr uint8_t kForegroundAlpha = 127;
constexpr float kDegrees = 57.29577951308232f;

// A member's pose stands where it was captured; everybody is drawn above the origin.
train::OwnedPose above_origin(const PoseView& pose) {
  return {{0, pose.root_translation_m[1], 0}, {pose.rotations.begin(), pose.rotations.end()}};
}

// Sum over the joints of 1 - |cos(angle / 2)|: grows with every joint's turn from one pose to the
// other.
double pose_difference(const train::OwnedPose& a, const train::OwnedPose& b) {
  double sum = 0;
  for (size_t j = 0; j + 3 < a.rotations.size(); j += 4) {
    double dot = 0, aa = 0, bb = 0;
    for (size_t k = j; k < j + 4; ++k) {
      dot += double(a.rotations[k]) * b.rotations[k];
      aa += double(a.rotations[k]) * a.rotations[k];
      bb += double(b.rotations[k]) * b.rotations[k];
    }
    sum += 1 - std::abs(dot) / std::sqrt(aa * bb);
  }
  return sum;
}

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

bool is_foreground(const Picture& picture, size_t pixel) {
  return picture.rgba[4 * pixel + 3] > kForegroundAlpha;
}

// Over mid-grey, in half levels: 510 is white.
int16_t half_levels(const Picture& picture, size_t pixel, int channel) {
  const uint8_t* p = &picture.rgba[4 * pixel];
  return static_cast<int16_t>(2 * p[channel] + 255 - p[3]);
}

constexpr double kHalfLevels2 = 510.0 * 510.0;

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

OpenedMember::OpenedMember(const Population& population, size_t member)
    : storage(member_floats(population)), avatar(open_member(population, member, storage)) {}

std::vector<train::OwnedPose> fixed_poses(const Population& population, const Motion* motion,
                                          size_t count) {
  std::vector<train::OwnedPose> poses, candidates;
  if (motion != nullptr) {
    for (size_t i = 0; i < count; ++i)
      poses.push_back(
          above_origin(motion->pose(uint32_t((2 * i + 1) * motion->frame_count / (2 * count)))));
    return poses;
  }
  for (const PopulationMember& member : population.members) {
    if (member.split == Split::kTrain && !member.golden.rotations.empty())
      candidates.push_back(
          above_origin({member.golden.root_translation_m, member.golden.rotations}));
  }
  if (candidates.empty())
    throw InputError("population '" + population.name +
                     "': its members have no golden pose; give a motion");
  poses.push_back(candidates.front());
  while (poses.size() < count) {
    const auto difference = [&](const train::OwnedPose& candidate) {
      double least = 1e9;
      for (const train::OwnedPose& taken : poses)
        least = std::min(least, pose_difference(candidate, taken));
      return least;
    };
    poses.push_back(*std::max_element(
        candidates.begin(), candidates.end(),
        [&](const auto& a, const auto& b) { return difference(a) < difference(b); }));
  }
  return poses;
}

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

SquaredError union_error(const Picture& a, const Picture& b) {
  FIG_CHECK(a.rgba.size() == b.rgba.size(), "pictures of one size");
  SquaredError error;
  int64_t sum = 0;
  for (size_t pixel = 0; pixel < a.rgba.size() / 4; ++pixel) {
    if (!is_foreground(a, pixel) && !is_foreground(b, pixel)) continue;
    for (int c = 0; c < 3; ++c) {
      const int64_t difference = half_levels(a, pixel, c) - half_levels(b, pixel, c);
      sum += difference * difference;
    }
    error.count += 3;
  }
  error.sum = static_cast<double>(sum) / kHalfLevels2;
  return error;
}

SquaredError union_error(std::span<const Picture> a, std::span<const Picture> b) {
  SquaredError error;
  for (size_t i = 0; i < a.size(); ++i) error.add(union_error(a[i], b[i]));
  return error;
}

namespace {

constexpr size_t kRun = 4096;  // as many squares of at most 510^2 stay within 32 bits

FIG_WIDEST_VECTORS uint32_t count_union(const int16_t* mask_a, const int16_t* mask_b,
                                        size_t count) {
  int32_t seen = 0;
  for (size_t i = 0; i < count; ++i) seen -= mask_a[i] | mask_b[i];
  return static_cast<uint32_t>(seen);
}

FIG_WIDEST_VECTORS uint32_t masked_squares(const int16_t* a, const int16_t* b,
                                           const int16_t* mask_a, const int16_t* mask_b,
                                           size_t count) {
  int32_t squares = 0;
  for (size_t i = 0; i < count; ++i) {
    const auto difference = static_cast<int16_t>((a[i] - b[i]) & (mask_a[i] | mask_b[i]));
    squares += int32_t(difference) * difference;
  }
  return static_cast<uint32_t>(squares);
}

}  // namespace

ComparedPictures::ComparedPictures(std::span<const std::vector<Picture>> members) {
  std::vector<std::pair<size_t, size_t>> kept;  // picture, pixel
  const size_t pictures = members.empty() ? 0 : members[0].size();
  for (size_t view = 0; view < pictures; ++view) {
    for (size_t pixel = 0; pixel < members[0][view].rgba.size() / 4; ++pixel) {
      const bool seen = std::any_of(members.begin(), members.end(), [&](const auto& own) {
        return is_foreground(own[view], pixel);
      });
      if (seen) kept.emplace_back(view, pixel);
    }
  }
  pixels_ = kept.size();
  values_.resize(members.size() * 3 * pixels_);
  foreground_.resize(members.size() * pixels_);
  for (size_t m = 0; m < members.size(); ++m) {
    for (size_t i = 0; i < pixels_; ++i) {
      const auto [view, pixel] = kept[i];
      for (int c = 0; c < 3; ++c)
        values_[(3 * m + c) * pixels_ + i] = half_levels(members[m][view], pixel, c);
      foreground_[m * pixels_ + i] = is_foreground(members[m][view], pixel) ? -1 : 0;
    }
  }
}

SquaredError ComparedPictures::error(size_t a, size_t b) const {
  uint64_t sum = 0, pixels = 0;
  for (size_t begin = 0; begin < pixels_; begin += kRun) {
    const size_t count = std::min(kRun, pixels_ - begin);
    const int16_t *mask_a = &foreground_[a * pixels_ + begin],
                  *mask_b = &foreground_[b * pixels_ + begin];
    pixels += count_union(mask_a, mask_b, count);
    for (size_t c = 0; c < 3; ++c) {
      sum += masked_squares(&values_[(3 * a + c) * pixels_ + begin],
                            &values_[(3 * b + c) * pixels_ + begin], mask_a, mask_b, count);
    }
  }
  return {static_cast<double>(sum) / kHalfLevels2, 3 * pixels};
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

}  // namespace figurine::evaluate
