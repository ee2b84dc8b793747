// Small synthetic bodies and avatars in memory: a jointed cylinder and a UNet of random weights,
// written and opened as packages.
//
// Everything follows from the sizes and the seed; no libm distribution is involved, so the bytes
// are the same on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "figurine/pose.h"

namespace figurine::tests {

// Bytes with the alignment that Package::open asks for.
class AlignedBytes {
 public:
  AlignedBytes() = default;
  explicit AlignedBytes(std::span<const std::byte> bytes);
  std::span<const std::byte> bytes() const { return {storage_.data() + offset_, size_}; }

 private:
  std::vector<std::byte> storage_;
  size_t offset_ = 0, size_ = 0;
};

// A repeatable stream of uniform numbers (PCG-like 64-bit LCG).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 0x632be59bd9b4e019u) {}
  float uniform(float low, float high);  // [low, high)
  float normal();                        // mean 0, variance 1, by the sum of 12 uniforms

 private:
  uint64_t state_;
};

struct SyntheticBodyOptions {
  uint32_t uv_size = 16;
  uint32_t joints = 4;  // a chain along y, root at the bottom
  uint32_t shapes = 2;
  uint64_t seed = 1;
  std::vector<std::string> joint_names = {};  // [joints]; empty: "joint0", ...
};
// Of the chain of four, so that the cylinder has a head, an upper and a lower body.
inline const std::vector<std::string> kPersonJoints{"left_knee", "pelvis", "spine1", "head"};

struct SyntheticBody {
  AlignedBytes bytes;
  std::unique_ptr<Package> package;
  const Body& body() const { return package->body(); }
};

enum class Held { kFloat32, kFixedPoint, kBoth };

struct SyntheticAvatarOptions {
  uint32_t channels = 4;
  uint32_t sh_degree = 0;
  uint32_t fourier_octaves = 1;
  TemplateMode template_mode = TemplateMode::kShaped;
  std::vector<float> shape = {0.5f, -0.5f};
  std::vector<float> colour =
      {};  // empty: a random one per avatar; otherwise the head's mean colour
  uint64_t seed = 1;
  Held held = Held::kFloat32;
  uint32_t network_step = 1;  // texels a side of a cell of the network's grid; 0: no network
  bool static_part = false;   // a RandomStaticPart
  bool filters = false;       // smallest extents up to 5 mm, and antialiased
  // Knows poses about the rest pose: deviations of 0.2 rad, training poses at 0.25 to 2 of them.
  bool known_poses = false;
  std::string name = "test avatar";
};

struct SyntheticAvatar {
  AlignedBytes bytes;
  std::unique_ptr<Package> package;
};

SyntheticBody make_test_body(const SyntheticBodyOptions& options = {});
SyntheticAvatar make_test_avatar(const SyntheticBody& body,
                                 const SyntheticAvatarOptions& options = {});

// A pose with moderately bent joints; frame 0 is the rest pose.
struct SyntheticPose {
  std::vector<float> rotations;
  PoseView view() const { return {root_translation_m, rotations}; }
  std::array<float, 3> root_translation_m{0, 0, 0};
};
SyntheticPose make_test_pose(const Body& body, uint32_t frame);

// What an avatar's network reads in a pose, by the definition: the maps of all texels, of which
// every cell has its source's, and Fourier channels. [T_n,T_n,channels].
std::vector<float> network_input(const Avatar& avatar, const Body& body, const PoseView& pose);

// A camera that sees the whole cylinder from +z.
Camera make_test_camera(uint32_t width_px, uint32_t height_px, float azimuth_deg = 0);

}  // namespace figurine::tests
