// An avatar: the weights of one pose UNet, how its input is standardised and its head is decoded,
// and the person's shape. What avatars have in common with the population that they are members of
// and with the sampler that draws them is declared here once (AvatarKind, AvatarTraits).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "figurine/fixed_point.h"
#include "figurine/network.h"
#include "figurine/status.h"

namespace figurine {

// Which canonical texels and joints the Gaussians sit on. The network's input is the mean
// template's in both cases.
enum class TemplateMode : uint8_t { kMean, kShaped };

// Head channels to Gaussians, per texel i with raw outputs h:
//   offset = offset_scale_m * clamp(h[0:3], -max_offset, max_offset), no clamp where max_offset is
//   0; scale = spacing_scale * texel_spacing_m[i] * exp(clamp(h[3:6], -max_log_scale,
//   max_log_scale)); quaternion = (1,0,0,0) + h[6:10], normalised; opacity = 1 / (1 + exp(-(h[10] +
//   opacity_bias)));   SH = h[11:].
struct HeadDecoding {
  float offset_scale_m = 0.05f;
  float spacing_scale = 0.6f;
  float max_log_scale = 4.0f;  // bounds what a pose far outside the training range can do; never
                               // active on trained poses
  float opacity_bias = 2.0f;
  uint32_t sh_degree = 0;
  // With a bound, a device knows before the network has run which texels a camera cannot see.
  float max_offset = 0;
};

// Mean and covariance of the training poses' body rotations, for telling how unusual a pose is:
// features are rotation vectors (axis times angle, radians) of the listed joints, of the root that
// of its tilt, concatenated (figurine/known_poses.h).
struct PoseStatistics {
  std::vector<uint8_t> joints;        // [P]
  std::span<const float> mean;        // [3P]
  std::span<const float> covariance;  // [3P,3P] symmetric, regularised to be positive definite
  // [Q] of the training poses, each measured against the others: value k is a distance that a share
  // of k / (Q - 1) of them do not exceed. Empty: not said, and no distance means anything.
  std::span<const float> distances;
};
inline constexpr size_t kMaxPoseDistances = 1025;
inline constexpr float kMaxPoseDistance = 1e6f;

// Which channels of the head a static part may hold: offset, log-scale, quaternion, opacity, and
// the three colours of SH degree 0.
inline constexpr uint32_t kStaticChannels = 14;
inline constexpr uint32_t kStaticColour = 11;  // the first of the colours

// Head channels with one grid, rounded to 8 bits: value = scale[c] * q.
struct StaticGroup {
  uint32_t first_channel = 0, channels = 0;
  uint32_t grid_size = 0;          // cells a side (figurine/texel_grid.h)
  std::span<const int8_t> values;  // [M,channels], -127 to 127
  std::span<const float> scale;    // [channels] > 0, normal
};

// What every texel's Gaussian has whatever the pose: the spatially varying bias of the head. Groups
// share no channel; channels in none are 0. With s the value at a texel (bilinear in the group's
// grid) and h the network's output there (bilinear in the network's grid; 0 without a network)
//
//   offset, log-scale, quaternion, opacity:  h' = h + s
//   SH degree 0 of a colour:                 h' = (h + kHalfColour) e^s - kHalfColour
//   SH above degree 0 of that colour:        h' = h e^s
//
// so that a colour is the network's times e^s, and 0 changes nothing.
struct StaticPart {
  std::vector<StaticGroup> groups;
  bool empty() const { return groups.empty(); }
};
// In units of SH degree 0's coefficient: the half that splatting adds to a colour.
inline constexpr float kHalfColour = 1.7724538509f;  // 0.5 / 0.28209479 = sqrt(pi)

// Bounds of |scale[c] * q|: far beyond what a person needs, and e^s and every sum stay finite.
inline constexpr float kMaxStaticValue = 1000;
inline constexpr float kMaxStaticLogGain = 20;  // of a colour

// Everything that makes the equations above defined over texels of uv_size a side: channels within
// kStaticChannels and in one group each, grids that fit, rows of `channels` values, none -128,
// scales positive, normal and within the bounds. kCorrupt "static part: group G: ...".
Status validate_static_part(const StaticPart& part, uint32_t uv_size);
// The same, and one row of values for every cell that the body covers.
Status validate_static_part(const StaticPart& part, const Body& body);
// What they say of the scales alone.
Status validate_static_scales(const StaticPart& part);

// How small an avatar's Gaussians may be: at every texel what the sharpest camera that saw it in
// training could resolve, a standard deviation in the canonical pose. Nothing that was trained says
// what a smaller Gaussian looks like closer by. With s = scale_m * code at the texel, after
// decoding
//
//   scale'_j = sqrt(scale_j^2 + s^2)      opacity' = opacity * prod_j scale_j / scale'_j
//
// a Gaussian blurred by one of deviation s, with the weight that it had; a code of 0 changes
// nothing. Based on: Yu et al., Mip-Splatting, CVPR 2024 (the 3D smoothing filter).
struct SmallestExtents {
  float scale_m = 0;               // > 0
  std::span<const uint8_t> codes;  // [N] of the body's texels
  bool empty() const { return codes.empty(); }
  float extent_m(size_t texel) const { return scale_m * static_cast<float>(codes[texel]); }
};
inline constexpr uint32_t kLargestExtentCode = 255;
// Bounds of scale_m: every square below has a float, and every s > 0 a square that is normal.
inline constexpr float kLeastExtentScale_m = 1e-9f;
inline constexpr float kMostExtentScale_m = 0.1f;

// None, or a scale within its bounds and at most a code for every texel of the map. kCorrupt
// "smallest extents: ...".
Status validate_smallest_extents(const SmallestExtents& extents, uint32_t uv_size);
// The same, and one code for every texel of the body.
Status validate_smallest_extents(const SmallestExtents& extents, const Body& body);

// In which arithmetic a network is evaluated.
enum class Precision : uint8_t { kFloat32, kFixedPoint };
const char* to_string(Precision precision);  // "f32", "q8"

struct GoldenFrame {
  std::array<float, 3> root_translation_m{0, 0, 0};
  std::span<const float> rotations;  // [J,4]
  Camera camera;
  std::array<float, 3> background{0.5f, 0.5f, 0.5f};
  std::span<const uint8_t>
      png;  // 8-bit RGB of the trainer's renderer over the background; may be empty
  // XXH3-128 (low, high) of the frame in fixed point: RGBA8 rows over the background, equal on
  // every CPU. Zero: none.
  std::array<uint64_t, 2> fixed_point_hash{0, 0};
  std::string fixed_point_library;  // the network library that the hash was made with, for people

  // Pose and camera alone: what another avatar's golden frame can be made from.
  GoldenFrame without_picture() const {
    GoldenFrame frame = *this;
    frame.png = {};
    frame.fixed_point_hash = {0, 0};
    frame.fixed_point_library.clear();
    return frame;
  }
};

// What all avatars of a population and all that a sampler draws have in common: the body that they
// stand on and the network that poses them. An avatar, a population and a sampler each are of a
// kind (it is their base, so that `avatar.network` stays short); kind() takes over all of it:
// avatar.kind() = sampler.kind().
struct AvatarKind {
  std::string body_name;
  std::array<uint64_t, 2> body_hash{0, 0};  // content hash of the body package (low, high)
  std::string preset;                       // for people; the layers decide
  TemplateMode template_mode = TemplateMode::kShaped;
  uint32_t fourier_octaves = 0;
  Network network;

  AvatarKind& kind() { return *this; }
  const AvatarKind& kind() const { return *this; }
};

// What goes with one set of weights: how maps enter the network, how its head is decoded, and a
// frame to test both by. An avatar and a member of a population have their own, a sampler has one
// for all that it draws.
struct AvatarTraits {
  MapStatistics map_statistics;
  HeadDecoding decoding;
  GoldenFrame golden;

  AvatarTraits& traits() { return *this; }
  const AvatarTraits& traits() const { return *this; }
};

// The network's float weights may be absent if fixed_point is there. The network may run on a grid
// coarser than the body's texels (network.input_size < uv_size; figurine/texel_grid.h), and there
// may be none (no layers, input_size, input_channels and fourier_octaves 0): then there is a static
// part.
struct Avatar : AvatarKind, AvatarTraits {
  std::string name;
  uint32_t uv_size = 0;           // T of the body; 0: that of the network, texels_a_side() says it
  std::span<const float> shape;   // [<= S]
  FixedPointNetwork fixed_point;  // empty if the package has none
  StaticPart static_part;         // empty if the package has none
  SmallestExtents smallest_extents;  // empty if the package has none
  bool antialiased = false;          // trained for SplatOptions::antialiased
  PoseStatistics pose_statistics;

  bool has_network() const { return !network.layers.empty(); }
  uint32_t texels_a_side() const { return uv_size != 0 ? uv_size : network.input_size; }  // T
  // A package holds one or both; both where there is no network to evaluate.
  bool holds(Precision precision) const {
    if (!has_network()) return true;
    return precision == Precision::kFixedPoint ? !fixed_point.empty() : has_weights(network);
  }
};

}  // namespace figurine
