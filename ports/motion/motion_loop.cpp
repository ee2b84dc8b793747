#include "ports/motion/motion_loop.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "ports/motion/rotation.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {
namespace {

constexpr uint32_t kMatchedJoints = kJaw;  // body joints: fingers, jaw and eyes do not decide
constexpr uint32_t kRateFrames = 2;  // rates are compared over this many frames to either side

// A clip in a frame of reference that turns with the figure.
struct Straight {
  std::vector<Quat> rotation;  // [F,55], the root's without the slow heading
  std::vector<Vec3> root;      // [F] path along +z
};

double heading_of(const Quat& q) {
  return std::atan2(2 * (q.x * q.z + q.w * q.y), 1 - 2 * (q.x * q.x + q.y * q.y));
}

Quat turn(double angle) { return about(Vec3(0, 1, 0), angle); }

// Headings without jumps of a full turn, averaged over about a gait cycle, so that what remains is
// the sway of the hips.
std::vector<double> slow_heading(const std::vector<Quat>& rotation, uint32_t frames,
                                 double cycle_frames) {
  std::vector<double> heading(frames);
  for (uint32_t f = 0; f < frames; ++f) {
    heading[f] = heading_of(rotation[size_t{f} * kJointCount]);
    if (f > 0)
      heading[f] -=
          2 * std::numbers::pi * std::round((heading[f] - heading[f - 1]) / (2 * std::numbers::pi));
  }
  const double sigma = 0.5 * cycle_frames;
  std::vector<double> slow(frames);
  for (uint32_t f = 0; f < frames; ++f) {
    // A straight line fitted under the window does not bend towards the middle at the clip's ends,
    // as a plain mean would.
    double s0 = 0, s1 = 0, s2 = 0, h0 = 0, h1 = 0;
    for (uint32_t i = 0; i < frames; ++i) {
      const double x = double(i) - double(f), w = std::exp(-0.5 * x * x / (sigma * sigma));
      s0 += w;
      s1 += w * x;
      s2 += w * x * x;
      h0 += w * heading[i];
      h1 += w * x * heading[i];
    }
    slow[f] = (s2 * h0 - s1 * h1) / (s0 * s2 - s1 * s1);
  }
  return slow;
}

Straight straighten(const MotionClip& clip, double cycle_frames) {
  Straight out;
  for (size_t i = 0; i < clip.rotations.size(); i += 4) {
    out.rotation.emplace_back(clip.rotations[i], clip.rotations[i + 1], clip.rotations[i + 2],
                              clip.rotations[i + 3]);
  }
  const std::vector<double> slow = slow_heading(out.rotation, clip.frame_count, cycle_frames);
  const auto place = [&](uint32_t f) {
    const float* p = &clip.root_translation_m[size_t{f} * 3];
    return Vec3(p[0], p[1], p[2]);
  };
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    Quat& root = out.rotation[size_t{f} * kJointCount];
    root = product(turn(-slow[f]), root);
    // Steps are turned, not places: the path unrolls.
    const Vec3 before = f == 0 ? Vec3(0, place(0).y, 0)
                               : out.root[f - 1] + rotated(turn(-0.5 * (slow[f] + slow[f - 1])),
                                                           place(f) - place(f - 1));
    out.root.push_back(before);
  }
  return out;
}

double squared_distance(const Straight& s, uint32_t a, uint32_t b) {
  double sum = 0;
  for (uint32_t j = 0; j < kMatchedJoints; ++j) {
    const double angle = angle_between(s.rotation[size_t{a} * kJointCount + j],
                                       s.rotation[size_t{b} * kJointCount + j]);
    sum += angle * angle / kMatchedJoints;
  }
  const double height = 5 * (s.root[a].y - s.root[b].y);  // 1 cm counts as 0.05 rad
  return sum + height * height;
}

}  // namespace

Result<MotionClip> make_loop(const MotionClip& clip, const LoopOptions& options,
                             LoopReport* report_out) {
  const auto frames_of = [&](float seconds) {
    return static_cast<uint32_t>(std::lround(double{seconds} * double{clip.frames_per_second}));
  };
  const uint32_t shortest = std::max(2 * kRateFrames, frames_of(options.shortest_s)),
                 longest = frames_of(options.longest_s);
  if (options.cycles == 0 || longest < shortest)
    return Status(StatusCode::kInvalidArgument,
                  "loop: no cycles, or the longest cycle is shorter than the shortest");
  if (clip.frame_count < shortest + 2 * kRateFrames + 1) {
    return Status(StatusCode::kInvalidArgument,
                  clip.name + ": loop: " + std::to_string(clip.frame_count) +
                      " frames are too few for a cycle of " + std::to_string(shortest));
  }
  const Straight straight = straighten(clip, 0.5 * (shortest + longest));

  LoopReport report;
  double best = 1e30;
  for (uint32_t a = kRateFrames; a + shortest + kRateFrames < clip.frame_count; ++a) {
    for (uint32_t length = shortest;
         length <= longest && a + length + kRateFrames < clip.frame_count; ++length) {
      double distance = 0;
      for (int shift : {-static_cast<int>(kRateFrames), 0, static_cast<int>(kRateFrames)}) {
        distance += squared_distance(straight, a + static_cast<uint32_t>(shift),
                                     a + length + static_cast<uint32_t>(shift));
      }
      if (distance < best) {
        best = distance;
        report.first_frame = a;
        report.length = length;
      }
    }
  }
  const uint32_t a = report.first_frame, length = report.length, b = a + length;
  report.gap_rad = static_cast<float>(std::sqrt(squared_distance(straight, a, b)));

  // What is missing at the end is spread over the cycle, a little to every frame.
  const Vec3 travelled = straight.root[b] - straight.root[a];
  Vec3 middle = Vec3(0);  // of the sway: the cycle is centred over the rest place
  for (uint32_t phase = 0; phase < length; ++phase)
    middle += (straight.root[a + phase] - double(phase) / length * travelled) / double(length);
  MotionClip out;
  out.name = clip.name;
  out.frames_per_second = clip.frames_per_second;
  out.frame_count = length * options.cycles;
  for (uint32_t f = 0; f < out.frame_count; ++f) {
    const uint32_t phase = f % length, source = a + phase;
    const double share = double(phase) / length;
    for (uint32_t j = 0; j < kJointCount; ++j) {
      const Quat& first = straight.rotation[size_t{a} * kJointCount + j];
      const Quat& last = straight.rotation[size_t{b} * kJointCount + j];
      const Quat closed = product(slerped(no_turn(), share, product(first, reversed(last))),
                                  straight.rotation[size_t{source} * kJointCount + j]);
      for (double value : {closed.w, closed.x, closed.y, closed.z})
        out.rotations.push_back(static_cast<float>(value));
    }
    // The path leads straight along +z at the mean speed; sway to the sides and up and down closes
    // like the rotations.
    Vec3 root = straight.root[source] - share * travelled;
    root.x -= middle.x;
    root.z -= middle.z;
    if (!options.in_place) root.z += std::hypot(travelled.x, travelled.z) * (f / length + share);
    for (int i = 0; i < 3; ++i) out.root_translation_m.push_back(static_cast<float>(root[i]));
  }
  make_continuous(out.rotations, kJointCount);
  if (report_out != nullptr) *report_out = report;
  return out;
}

}  // namespace figurine::ports
