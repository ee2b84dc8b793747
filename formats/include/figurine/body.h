// A body at one UV resolution T: joints, and per covered texel its canonical place, normal, skin
// weights and shape directions. Not a mesh.
//
// Letters: J joints, S shape coefficients, N covered texels, T texels a side, K = kSkinInfluences.
// "Covered" texels carry a Gaussian each; "border" texels are the two-texel dilation around the
// charts, which only the UNet's input maps fill. All arrays are borrowed from the package's bytes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/pose.h"

namespace figurine {

inline constexpr uint32_t kMaxUvSize = 1024;
inline constexpr uint32_t kMaxShapeCoefficients = 64;
inline constexpr uint32_t kPositionChannels = 3;
inline constexpr uint32_t kMapChannels = 6;  // position 3, normal 3

struct Body {
  std::string name;
  uint32_t uv_size = 0;                  // T
  std::vector<std::string> joint_names;  // [J]
  std::span<const int16_t> parents;      // [J]

  // The mean template (shape coefficients 0) and its directions.
  std::span<const float> joint_position_m;     // [J,3]
  std::span<const float> joint_shape_basis_m;  // [S,J,3] metres per unit of the coefficient

  std::span<const uint32_t> texel;          // [N] v * T + u, strictly ascending
  std::span<const float> texel_position_m;  // [N,3]
  std::span<const float> texel_normal;      // [N,3] unit
  std::span<const uint8_t> texel_joints;    // [N,K]
  std::span<const float> texel_weights;     // [N,K] >= 0, sum 1 within 1e-4
  std::span<const float>
      texel_spacing_m;  // [N] distance to the neighbouring texels on the surface, > 0
  std::span<const float> texel_shape_basis_m;  // [S,N,3]

  std::span<const uint32_t> border_texel;  // [D] texels that only the maps fill
  std::span<const uint32_t>
      border_source;  // [D] row in [0,N) whose map value the border texel repeats

  // Where the texels lie on the mesh that the body was made from, which the package does not hold:
  // for whoever has that mesh. Empty where the map is the mesh's own UV layout, which says as much.
  std::span<const uint32_t> texel_triangle;  // [N] in the mesh's order
  std::span<const float> texel_barycentric;  // [N,3] weights of its corners, sum 1 within 1e-4

  uint32_t joint_count() const { return static_cast<uint32_t>(parents.size()); }
  uint32_t texel_count() const { return static_cast<uint32_t>(texel.size()); }
  uint32_t shape_count() const {
    return parents.empty()
               ? 0
               : static_cast<uint32_t>(joint_shape_basis_m.size() / (3 * parents.size()));
  }
  SkeletonView mean_skeleton() const { return {parents, joint_position_m}; }
};

// The person's own canonical texels and joints: mean + sum_s shape[s] basis[s]. shape may be
// shorter than S (the rest is zero). joint_position_m: [J,3], texel_position_m: [N,3], both sized
// by the caller.
void shape_body(const Body& body, std::span<const float> shape, std::span<float> joint_position_m,
                std::span<float> texel_position_m);

// How the network sees the maps: channel c becomes (value - mean[c]) * scale[c].
struct MapStatistics {
  std::array<float, kMapChannels> mean{0, 0, 0, 0, 0, 0};
  std::array<float, kMapChannels> scale{2, 2, 2, 1, 1, 1};  // position / 0.5 m, unit normals
};

// The UNet's pose input, always of the mean template (paper, section 4.1): per covered or border
// texel the posed position minus the root joint's world position, and the posed normal, both
// standardised; every other texel is zero in all channels. Scratch holds J transforms. maps:
// [T,T,stride] floats, channels 0..5 of each texel are written (all T*T of them), the rest of the
// stride is left alone.
void draw_pose_maps(const Body& body, const PoseView& pose, const MapStatistics& statistics,
                    std::span<Affine> scratch, uint32_t stride, std::span<float> maps);

// Constant input channels, for octave o in [0, octaves):
//   channel 4 o + 0: sin(pi 2^o x)   1: cos(pi 2^o x)   2: sin(pi 2^o y)   3: cos(pi 2^o y),   x =
//   (u + 0.5) / T, y = (v + 0.5) / T.
// Not in the paper (docs/decisions/0005-fourier-channels.md). Values are computed in double and
// rounded once. maps: [T,T,stride], channels first .. first + 4 octaves - 1 are written for all
// texels, covered or not.
void draw_fourier_channels(uint32_t uv_size, uint32_t octaves, uint32_t first, uint32_t stride,
                           std::span<float> maps);

}  // namespace figurine
