// Performers who misbehave: a joint that spins faster than frames come, rotations that are none,
// clocks that go back. What a figure shows is in every case a pose, and the newest sound one.
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "ports/vmc/vmc_state.h"
#include "tests/ports/vmc/smplx_figure.h"
#include "tests/ports/vmc/vmc_sender.h"
#include "tests/stability/rows.h"

namespace figurine::stability {
namespace live {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr uint64_t kSecond_ns = 1'000'000'000;

// What a figure shows of a performer, held to what a pose is.
class Watcher {
 public:
  explicit Watcher(const ports::VmcState& state) : state_(state) {}

  void look(uint64_t now_ns) {
    rig_.to_body(state_.pose(), rotations_, root_);
    const double presence = state_.presence(now_ns);
    ports::ease_to_rest(presence, rotations_, root_);
    ++poses;
    unsound += !validate_pose({root_, rotations_}, uint32_t(figure_.count())).ok() ||
               !(presence >= 0 && presence <= 1);
    skinning_transforms(figure_.rest(), {root_, rotations_}, world_);
    const double reach = glm::distance(at("left_elbow"), at("left_wrist"));
    if (poses == 1) first_reach_ = reach;
    largest_stretch_m = std::max(largest_stretch_m, std::abs(reach - first_reach_));
  }
  glm::dvec3 forearm() const { return glm::normalize(at("left_wrist") - at("left_elbow")); }

  uint64_t poses = 0, unsound = 0;
  double largest_stretch_m = 0;

 private:
  glm::dvec3 at(const char* joint) const {
    const size_t j = figure_.joint(joint);
    const auto p = transform_point(world_[j], &figure_.rest().rest_position_m[3 * j]);
    return {p[0], p[1], p[2]};
  }

  const ports::VmcState& state_;
  tests::SmplxFigure figure_;
  ports::HumanoidRig rig_ =
      std::move(ports::HumanoidRig::create(figure_.names(), figure_.rest())).value();
  std::vector<float> rotations_ = std::vector<float>(4 * figure_.count());
  std::array<float, 3> root_{};
  std::vector<Affine> world_ = std::vector<Affine>(figure_.count());
  double first_reach_ = 0;
};

Rows pose_rows(const std::string& name, const Watcher& watcher) {
  return {
      {name, "poses that are none", Bound::kAtMost, 0, double(watcher.unsound)},
      {name, "metres that the forearm stretches", Bound::kAtMost, 1e-6, watcher.largest_stretch_m}};
}

// Fifty turns a second, sent and drawn sixty times a second: next to half a turn from frame to
// frame and no way to say which way round.
Rows spinning_joint() {
  ports::VmcState state;
  Watcher watcher(state);
  double largest = 0;
  for (int frame = 0; frame < 600; ++frame) {
    const uint64_t now_ns = uint64_t(frame) * kSecond_ns / 60;
    const double angle = 2 * kPi * 50 * frame / 60;
    // The left arm points along x in the T-pose; about y it goes round in the plane.
    state.receive(
        tests::vmc_bone("LeftLowerArm", glm::angleAxis(angle, glm::dvec3(0, 1, 0))).packet(),
        now_ns);
    watcher.look(now_ns);
    const glm::dvec3 wanted(std::cos(angle), 0, -std::sin(angle));
    largest = std::max(largest, glm::distance(watcher.forearm(), wanted));
  }
  Rows rows = pose_rows("a joint that spins at 50 Hz", watcher);
  rows.push_back({"a joint that spins at 50 Hz", "largest distance of the forearm's direction",
                  Bound::kAtMost, 5e-6, largest});
  return rows;
}

Rows rotations_that_are_none() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                   kInfinity = std::numeric_limits<double>::infinity();
  const glm::dquat none[] = {{kNan, 0, 0, 0},      {1, kNan, kNan, kNan}, {0, 0, 0, 0},
                             {kInfinity, 0, 0, 0}, {1e38, 1e38, 1e38, 0}, {1, 0, -kInfinity, 0}};
  ports::VmcState state;
  Watcher watcher(state);
  uint64_t sent = 0;
  for (int frame = 0; frame < 300; ++frame) {
    const uint64_t now_ns = uint64_t(frame) * kSecond_ns / 60;
    for (const char* bone : {"Hips", "LeftLowerArm", "Neck"})
      state.receive(tests::vmc_bone(bone, none[sent++ % std::size(none)]).packet(), now_ns);
    if (frame % 7 == 0)
      state.receive(tests::vmc_bone("Head", glm::dquat(1, 0, 0, 0)).packet(), now_ns);
    watcher.look(now_ns);
  }
  const char* name = "rotations that are none";
  Rows rows = pose_rows(name, watcher);
  rows.push_back({name, "of them not counted as dropped", Bound::kAtMost, 0,
                  std::abs(double(sent) - double(state.counts().dropped))});
  return rows;
}

// The sender's clock and the order of arrival, each going back.
Rows time_going_back() {
  ports::VmcState state;
  Watcher watcher(state);
  double largest = 0;
  for (int frame = 0; frame < 300; ++frame) {
    const uint64_t now_ns = 100 * kSecond_ns - uint64_t(frame) * kSecond_ns / 60;
    const double angle = 0.01 * frame;
    tests::OscWriter time;
    time.message("/VMC/Ext/T", "f").real(static_cast<float>(50 - frame));
    state.receive(time.packet(), now_ns);
    state.receive(
        tests::vmc_bone("LeftLowerArm", glm::angleAxis(angle, glm::dvec3(0, 1, 0))).packet(),
        now_ns);
    watcher.look(now_ns - kSecond_ns);
    const glm::dvec3 wanted(std::cos(angle), 0, -std::sin(angle));
    largest = std::max(largest, glm::distance(watcher.forearm(), wanted));
  }
  const char* name = "clocks that go back";
  Rows rows = pose_rows(name, watcher);
  rows.push_back({name, "largest distance of the forearm's direction from the newest",
                  Bound::kAtMost, 5e-6, largest});
  return rows;
}

constexpr Case kCases[] = {{"SpinningJoint", spinning_joint},
                           {"PerformedRotationsThatAreNone", rotations_that_are_none},
                           {"TimeGoingBack", time_going_back}};

}  // namespace
}  // namespace live

std::span<const Case> live_cases() { return live::kCases; }

}  // namespace figurine::stability
