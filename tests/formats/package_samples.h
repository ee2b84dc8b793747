// Small sound packages of each kind, with the storage behind their spans, for the tests of the
// package: a body of 3 joints and 5 texels on an 8x8 map, an avatar of a four-resolution UNet with
// 2 channels, a motion of 3 frames, a sampler of such avatars. All values are exact in binary, so
// the bytes are the same everywhere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "formats/writer/package_writer.h"
#include "formats/writer/population_writer.h"
#include "formats/writer/sampler_writer.h"

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
  std::vector<std::vector<float>> weights,
      biases;  // one each per layer; empty where the layer is no convolution
  std::vector<float> pose_mean, pose_covariance;
  std::vector<float> golden_rotations;
  std::vector<uint8_t> golden_png;
  Avatar avatar;
  Budget budget;

  Result<std::vector<std::byte>> write() const {
    return write_package(avatar, budget, make_provenance());
  }
};

// The same avatar in fixed point alone; with_floats() gives it back its float weights.
struct FixedPointAvatarSample : AvatarSample {
  FixedPointAvatarSample();
  std::vector<std::vector<int8_t>> fixed_weights;
  std::vector<std::vector<float>> fixed_scales;
  std::vector<std::vector<int32_t>> fixed_biases;

  FixedPointAvatarSample& with_floats();
};

// The same avatar on the sample body with a static part at two grids and a network at half the
// side: geometry at 2 x 2 cells, colour at every texel.
struct StaticAvatarSample : AvatarSample {
  StaticAvatarSample();
  std::vector<int8_t> geometry, colour;             // [2,11], [5,3]
  std::vector<float> geometry_scale, colour_scale;  // [11], [3]

  StaticGroup& group(size_t g) { return avatar.static_part.groups[g]; }
};

// Its static part alone: no network.
struct StaticOnlyAvatarSample : StaticAvatarSample {
  StaticOnlyAvatarSample();
};

// The avatar with a static part, and the filters of one that was trained for near and far.
struct FilteredAvatarSample : StaticAvatarSample {
  FilteredAvatarSample();
  std::vector<uint8_t> extents;  // [5]
};

// The avatar with a table of its training poses' distances, of the root and of another joint.
struct KnownPosesAvatarSample : AvatarSample {
  KnownPosesAvatarSample();
  std::vector<float> pose_distances;  // [5]
};

// Three avatars of one network, each a little different from common initial weights: one
// population, in integers or in halves.
struct PopulationSample {
  explicit PopulationSample(DifferenceCoding coding = DifferenceCoding::kInt8);
  PopulationSample(const PopulationSample&) = delete;
  std::unique_ptr<AvatarSample> initial;               // whose weights are the common ones
  std::vector<std::unique_ptr<AvatarSample>> avatars;  // [3]
  std::vector<Provenance> provenance;                  // [3]
  NewPopulation population;

  Result<std::vector<std::byte>> write() const { return write_population(population); }
};

// Three avatars with static parts, each a little different from the others', antialiased. Of kNone
// all have the network of `initial`, the shared one, and the third has no copy of it.
struct StaticPopulationSample {
  explicit StaticPopulationSample(DifferenceCoding coding = DifferenceCoding::kNone);
  StaticPopulationSample(const StaticPopulationSample&) = delete;
  std::unique_ptr<StaticAvatarSample> initial;
  std::vector<std::unique_ptr<StaticAvatarSample>> avatars;  // [3]
  std::vector<Provenance> provenance;                        // [3]
  NewPopulation population;

  Result<std::vector<std::byte>> write() const { return write_population(population); }
};

struct MotionSample {
  MotionSample();
  MotionSample(const MotionSample&) = delete;
  std::vector<float> root_translation, rotations;
  Motion motion;

  Result<std::vector<std::byte>> write() const { return write_package(motion, make_provenance()); }
};

// Samples avatars like AvatarSample: 16 tokens of rank 1 or 2, a denoiser of two blocks.
struct SamplerSample {
  SamplerSample();
  SamplerSample(const SamplerSample&) = delete;
  std::vector<float> mean, direction_scale, row_scale, bias, position, norm;
  std::vector<int8_t> directions, matrices;
  std::vector<float> pose_mean, pose_covariance, golden_rotations;
  std::string report;
  Sampler sampler;
  Budget budget;

  Result<std::vector<std::byte>> write() const {
    return write_sampler({.sampler = &sampler, .budget = budget, .provenance = make_provenance()});
  }

 protected:
  void fill_denoiser(size_t tokens);  // matrices, their scales and biases, positions
};

// Samples the static parts of avatars of one network, antialiased: a token of the shape, four of
// patches of two groups.
struct StaticSamplerSample : SamplerSample {
  StaticSamplerSample();
  FixedPointAvatarSample network;
  std::vector<float> geometry_scale, colour_scale;  // [11], [3]
  std::vector<uint32_t> geometry_row, colour_row;   // [2], [5]

 private:
  void fill_space();
};

// One of each, for tests of what all packages have in common.
enum class SampleKind {
  kBody,
  kAvatar,
  kFixedPointAvatar,
  kMotion,
  kPopulation,
  kHalfPopulation,
  kSampler,
  kStaticAvatar,
  kStaticOnlyAvatar,
  kFilteredAvatar,
  kStaticPopulation,
  kStaticSampler,
  kKnownPosesAvatar
};
inline constexpr SampleKind kSampleKinds[] = {SampleKind::kBody,
                                              SampleKind::kAvatar,
                                              SampleKind::kFixedPointAvatar,
                                              SampleKind::kMotion,
                                              SampleKind::kPopulation,
                                              SampleKind::kHalfPopulation,
                                              SampleKind::kSampler,
                                              SampleKind::kStaticAvatar,
                                              SampleKind::kStaticOnlyAvatar,
                                              SampleKind::kFilteredAvatar,
                                              SampleKind::kStaticPopulation,
                                              SampleKind::kStaticSampler,
                                              SampleKind::kKnownPosesAvatar};
std::string to_string(SampleKind kind);  // also the name of its golden file: "fixed_point_avatar"
PackageKind package_kind(SampleKind kind);
Result<std::vector<std::byte>> write_sample(SampleKind kind);

}  // namespace figurine::samples
