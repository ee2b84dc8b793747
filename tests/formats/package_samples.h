// Small sound packages of each kind, with the storage behind their spans, for the tests of the package: a body of 3 joints and 5 texels on
// an 8x8 map, an avatar of a four-resolution UNet with 2 channels, a motion of 3 frames. All values are exact in binary, so the bytes are
// the same everywhere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "figurine/package.h"
#include "formats/writer/package_writer.h"

namespace figurine::samples {

Provenance make_provenance();

struct BodySample {
  BodySample();
  BodySample(const BodySample&) = delete;
  std::vector<int16_t> parents;
  std::vector<float> joint_position, joint_shape_basis;
  std::vector<uint32_t> texel;
  std::vector<float> texel_position, texel_normal;
  std::vector<uint8_t> texel_joints;
  std::vector<float> texel_weights, texel_spacing, texel_shape_basis;
  std::vector<uint32_t> border_texel, border_source;
  Body body;  // its spans point at the vectors above

  Result<std::vector<std::byte>> write() const { return write_package(body, make_provenance()); }
};

struct AvatarSample {
  AvatarSample();
  AvatarSample(const AvatarSample&) = delete;
  std::vector<float> shape;
  std::vector<std::vector<float>> weights, biases;  // one each per layer; empty where the layer is no convolution
  std::vector<float> pose_mean, pose_covariance;
  std::vector<float> golden_rotations;
  std::vector<uint8_t> golden_png;
  Avatar avatar;
  Budget budget;

  Result<std::vector<std::byte>> write() const { return write_package(avatar, budget, make_provenance()); }
};

struct MotionSample {
  MotionSample();
  MotionSample(const MotionSample&) = delete;
  std::vector<float> root_translation, rotations;
  Motion motion;

  Result<std::vector<std::byte>> write() const { return write_package(motion, make_provenance()); }
};

}  // namespace figurine::samples
