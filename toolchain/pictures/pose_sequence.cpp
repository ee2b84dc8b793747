#include "toolchain/pictures/pose_sequence.h"

#include <cmath>

#include "figurine/check.h"
#include "toolchain/random/counter.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::pictures {

using measure::kMidGrey;
using measure::SquaredError;

namespace {

constexpr uint64_t kTrembleSeed = 1, kRootStream = 1, kAxisStream = 2;
constexpr float kRootTremble_m = 1e-3f;
constexpr float kJointTremble_rad = 0.05f * 3.14159265f / 180;

// Uniform in [-1, 1).
float random_signed(uint64_t stream, uint64_t counter) {
  return 2 * random::random_unit(kTrembleSeed, stream, counter) - 1;
}

std::array<float, 4> normalised(std::array<float, 4> q) {
  const float length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (float& value : q) value /= length;
  return q;
}

std::array<float, 4> interpolate(const float* a, const float* b, float t) {
  const float dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const float sign = dot < 0 ? -1.0f : 1.0f;  // b and -b are one rotation; this is the near one
  std::array<float, 4> q;
  for (int k = 0; k < 4; ++k) q[k] = (1 - t) * a[k] + sign * t * b[k];
  return normalised(q);
}

std::array<float, 4> product(const float* a, const std::array<float, 4>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

// A turn by kJointTremble_rad about a random axis.
std::array<float, 4> tremble(uint64_t counter) {
  std::array<float, 3> axis;
  for (uint64_t k = 0; k < 3; ++k) axis[k] = random_signed(kAxisStream, 3 * counter + k);
  const float length =
      std::max(1e-3f, std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]));
  const float sine = std::sin(kJointTremble_rad / 2) / length;
  return {std::cos(kJointTremble_rad / 2), sine * axis[0], sine * axis[1], sine * axis[2]};
}

bool is_foreground(const std::vector<float>& picture, size_t pixel) {
  return picture[4 * pixel + 3] > 0.5f;
}

double over_grey(const std::vector<float>& picture, size_t pixel, int channel) {
  return picture[4 * pixel + channel] + (1 - picture[4 * pixel + 3]) * kMidGrey;
}

// prediction null: never changes.
SquaredError error_of_changes(const FloatPictures* prediction, const FloatPictures& truth) {
  SquaredError error;
  for (size_t frame = 0; frame + 1 < truth.size(); ++frame) {
    const std::vector<float>&before = truth[frame], &after = truth[frame + 1];
    for (size_t pixel = 0; pixel < before.size() / 4; ++pixel) {
      if (!is_foreground(before, pixel) || !is_foreground(after, pixel)) continue;
      for (int c = 0; c < 3; ++c) {
        double change = over_grey(after, pixel, c) - over_grey(before, pixel, c);
        if (prediction != nullptr)
          change -= over_grey((*prediction)[frame + 1], pixel, c) -
                    over_grey((*prediction)[frame], pixel, c);
        error.sum += change * change;
      }
      error.count += 3;
    }
  }
  return error;
}

}  // namespace

PoseSequence slow_motion(std::span<const train::OwnedPose> keys, uint32_t slower,
                         const Camera& camera) {
  FIG_CHECK(keys.size() >= 2 && slower >= 1, "two key poses");
  PoseSequence sequence{"slow_motion", {}, camera};
  for (size_t key = 0; key + 1 < keys.size(); ++key) {
    const train::OwnedPose &a = keys[key], &b = keys[key + 1];
    for (uint32_t step = 0; step < slower; ++step) {
      const float t = static_cast<float>(step) / static_cast<float>(slower);
      train::OwnedPose pose = a;
      for (int k = 0; k < 3; ++k)
        pose.root_translation_m[k] =
            (1 - t) * a.root_translation_m[k] + t * b.root_translation_m[k];
      for (size_t at = 0; at < pose.rotations.size(); at += 4) {
        const std::array<float, 4> q = interpolate(&a.rotations[at], &b.rotations[at], t);
        std::copy(q.begin(), q.end(), &pose.rotations[at]);
      }
      sequence.poses.push_back(std::move(pose));
    }
  }
  sequence.poses.push_back(keys.back());
  return sequence;
}

PoseSequence trembling_pose(const train::OwnedPose& pose, uint32_t frames, const Camera& camera) {
  PoseSequence sequence{"trembling_pose", {}, camera};
  const uint64_t joints = pose.rotations.size() / 4;
  for (uint64_t frame = 0; frame < frames; ++frame) {
    train::OwnedPose moved = pose;
    for (uint64_t k = 0; k < 3; ++k)
      moved.root_translation_m[k] += kRootTremble_m * random_signed(kRootStream, 3 * frame + k);
    for (uint64_t joint = 0; joint < joints; ++joint) {
      const std::array<float, 4> q =
          product(&pose.rotations[4 * joint], tremble(frame * joints + joint));
      std::copy(q.begin(), q.end(), &moved.rotations[4 * joint]);
    }
    sequence.poses.push_back(std::move(moved));
  }
  return sequence;
}

FloatPictures render_sequence(train::TrainedAvatar& avatar, const PoseSequence& sequence) {
  FloatPictures pictures;
  for (const train::OwnedPose& pose : sequence.poses) {
    const train::PosedBody posed = avatar.model().pose(pose.view());
    pictures.push_back(
        avatar.model().render_rgba(avatar.model().evaluate(posed), posed, sequence.camera));
  }
  return pictures;
}

SquaredError change_error(const FloatPictures& prediction, const FloatPictures& truth) {
  FIG_CHECK(prediction.size() == truth.size(), "sequences of one length");
  return error_of_changes(&prediction, truth);
}

SquaredError frozen_error(const FloatPictures& truth) { return error_of_changes(nullptr, truth); }

}  // namespace figurine::pictures
