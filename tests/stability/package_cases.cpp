// Numbers that no package may carry, and odd ones that it may: what the reader lets through is what
// the frame path relies on. (Bytes that are no package at all are the business of the reader's own
// hostile tests.)
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "tests/golden/posing/five_texels_packages.h"
#include "tests/stability/rows.h"

namespace figurine::stability {
namespace package {
namespace {

using golden::five_texels_avatar;
using golden::five_texels_provenance;
using golden::FiveTexels;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

using BodyChange = std::function<void(FiveTexels&)>;  // of the storage behind the spans
using AvatarChange = std::function<void(FiveTexels&, Avatar&)>;

bool accepts_body(const BodyChange& change) {
  FiveTexels example;
  change(example);
  return write_package(example.body, five_texels_provenance())
      .ok();  // opens what it wrote, so this is the reader's word
}

bool accepts_avatar(const AvatarChange& change) {
  FiveTexels example;
  Avatar avatar = five_texels_avatar(example, {1, 2});
  change(example, avatar);
  return write_package(avatar,
                       {.peak_memory_bytes = 1 << 20, .macs_per_frame = 2240, .gaussians = 5},
                       five_texels_provenance())
      .ok();
}

bool accepts_motion(
    const std::function<void(std::vector<float>&, std::vector<float>&, Motion&)>& change) {
  std::vector<float> translation(6, 0.25f),
      rotations{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.6f, 0.8f, 0, 0, 1, 0, 0, 0, 0, 0, 0, -1};
  Motion motion{.name = "two frames",
                .frames_per_second = 30,
                .joint_names = {"pelvis", "spine", "head"},
                .frame_count = 2,
                .root_translation_m = translation,
                .rotations = rotations};
  change(translation, rotations, motion);
  return write_package(motion, five_texels_provenance()).ok();
}

Rows unsound_numbers() {
  const std::vector<BodyChange> bodies = {
      [](FiveTexels& e) { e.joints[4] = kNan; },
      [](FiveTexels& e) { e.joints[4] = 1e30f; },
      [](FiveTexels& e) { e.positions[7] = kInfinity; },
      [](FiveTexels& e) { e.normals[3] = 3; },
      [](FiveTexels& e) { e.normals[3] = kNan; },
      [](FiveTexels& e) { e.normals[0] = e.normals[1] = e.normals[2] = 0; },
      [](FiveTexels& e) { e.weights[0] = 1.1f; },
      [](FiveTexels& e) { e.weights[0] = kNan; },
      [](FiveTexels& e) { e.weights[8] = -0.375f, e.weights[9] = 1.375f; },
      [](FiveTexels& e) { e.spacing[2] = 0; },
      [](FiveTexels& e) { e.spacing[2] = -0.1f; },
      [](FiveTexels& e) { e.spacing[2] = kInfinity; },
      [](FiveTexels& e) { e.basis[1] = kNan; },
      [](FiveTexels& e) { e.joint_basis[1] = -kInfinity; },
      [](FiveTexels& e) { e.texel_joints[1] = 3; },
      [](FiveTexels& e) { e.parents[1] = 2; },
      [](FiveTexels& e) { e.parents[0] = 0; },
  };
  const std::vector<AvatarChange> avatars = {
      [](FiveTexels& e, Avatar&) { e.network_weights[11] = kNan; },
      [](FiveTexels& e, Avatar&) { e.network_bias[3] = kInfinity; },
      [](FiveTexels& e, Avatar&) { e.shape[0] = kNan; },
      [](FiveTexels& e, Avatar&) { e.shape[0] = 1e10f; },
      [](FiveTexels& e, Avatar&) { e.rotations[4] = kNan; },
      [](FiveTexels& e, Avatar&) {
        e.rotations[8] = e.rotations[9] = e.rotations[10] = e.rotations[11] = 0;
      },
      [](FiveTexels&, Avatar& a) { a.map_statistics.scale[1] = 0; },
      [](FiveTexels&, Avatar& a) { a.map_statistics.scale[1] = -1; },
      [](FiveTexels&, Avatar& a) { a.map_statistics.mean[5] = kNan; },
      [](FiveTexels&, Avatar& a) { a.decoding.offset_scale_m = 0; },
      [](FiveTexels&, Avatar& a) { a.decoding.spacing_scale = kInfinity; },
      [](FiveTexels&, Avatar& a) { a.decoding.max_log_scale = 80; },
      [](FiveTexels&, Avatar& a) { a.decoding.opacity_bias = kNan; },
      [](FiveTexels&, Avatar& a) { a.golden.camera.near_m = 0; },
      [](FiveTexels&, Avatar& a) { a.golden.camera.view_from_world[0] = 2; },
      [](FiveTexels&, Avatar& a) { a.golden.background[1] = kNan; },
  };
  const std::vector<std::function<void(std::vector<float>&, std::vector<float>&, Motion&)>>
      motions = {
          [](auto& t, auto&, Motion&) { t[1] = kNan; },
          [](auto&, auto& r, Motion&) { r[4] = kInfinity; },
          [](auto&, auto& r, Motion&) { r[0] = 0; },
          [](auto&, auto& r, Motion&) { r[0] = 1e-20f; },
          [](auto&, auto&, Motion& m) { m.frames_per_second = 0; },
          [](auto&, auto&, Motion& m) { m.frames_per_second = -30; },
          [](auto&, auto&, Motion& m) { m.frames_per_second = kNan; },
      };
  double accepted = 0;
  for (const auto& change : bodies) accepted += accepts_body(change);
  for (const auto& change : avatars) accepted += accepts_avatar(change);
  for (const auto& change : motions) accepted += accepts_motion(change);
  const size_t tried = bodies.size() + avatars.size() + motions.size();
  return {{std::to_string(tried) + " packages, each with one unsound number", "packages accepted",
           Bound::kAtMost, 0, accepted}};
}

Rows odd_but_sound_numbers() {
  constexpr float kDenormal = std::numeric_limits<float>::denorm_min();
  double refused = 0;
  refused += !accepts_body([](FiveTexels&) {});
  refused += !accepts_body([](FiveTexels& e) { e.positions[7] = kDenormal; });
  refused += !accepts_body(
      [](FiveTexels& e) { e.weights[0] = 1 - 5e-6f; });  // sums to 1 within the allowed 1e-5
  refused += !accepts_body([](FiveTexels& e) { e.spacing[2] = 1e-6f; });
  refused += !accepts_avatar([](FiveTexels&, Avatar&) {});
  refused += !accepts_avatar([](FiveTexels& e, Avatar&) { e.network_weights[11] = kDenormal; });
  refused += !accepts_avatar([](FiveTexels& e, Avatar&) { e.network_weights[11] = 3e38f; });
  refused += !accepts_avatar(
      [](FiveTexels& e, Avatar&) { e.network_weights.assign(e.network_weights.size(), 0); });
  refused += !accepts_avatar([](FiveTexels&, Avatar& a) { a.shape = {}; });
  refused += !accepts_motion([](auto&, auto&, Motion&) {});
  return {{"10 packages with odd but sound numbers (denormals, 3e38, all zero)", "packages refused",
           Bound::kAtMost, 0, refused}};
}

constexpr Case kCases[] = {{"UnsoundNumbers", unsound_numbers},
                           {"OddButSoundNumbers", odd_but_sound_numbers}};

}  // namespace
}  // namespace package

std::span<const Case> package_cases() { return package::kCases; }

}  // namespace figurine::stability
