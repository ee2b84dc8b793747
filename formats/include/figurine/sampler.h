// A sampler: what draws the weights of new avatars on the device. A denoiser (the paper's
// transformer) over a space of weights, in int8, and everything that all its avatars share.
//
// Letters: L tokens (one a convolution, unless all avatars have one network; one for the shape
// coefficients if there are any; one a patch of every static group), K_l directions of token l, D =
// sum of K_l, W values of an avatar in its tokens, d = d_model, f = feed_forward, B blocks, R rows
// of all matrices together.
//
//   weights:  w = mean + sum over k of (x_k * direction_scale_k) * q_k      x: D values, of mean
//             square about 1; q_k: int8 direction
//   static integers of them:  q = clamp(round(w / scale), -127, 127)        round: to nearest, ties
//             to even
//   a matrix: y_n = sum over k of row_scale_n * q_nk * x_k + bias_n         n: rows; q: int8, -127
//       to 127
//
// All floats are finite and of magnitude at most 1e6, so that no matrix's result and no sampled
// weight leaves the range of a float. What the numbers do is in docs/numerics.md, "Sampling on the
// device"; the runtime's src/sample evaluates them.
//
// Based on: the paper, section 4.2; Erkoc et al., HyperDiffusion, 2023. The directions are ours.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/detail/noise_level.h"

namespace figurine {

inline constexpr uint32_t kMaxDenoiserWidth =
    4096;  // of d, f, K_l: the exact integer sums hold so many products (docs/numerics.md)
inline constexpr uint32_t kMaxDenoiserBlocks = 64;
inline constexpr size_t kMaxSolverSteps = 1000;

enum class SolverMethod : uint8_t { kDdim, kDpmSolverPlusPlus2M };
const char* to_string(SolverMethod method);  // "ddim", "dpmpp2m"

struct DenoiserShape {
  uint32_t d_model = 0;  // a multiple of 2 * heads
  uint32_t blocks = 0;
  uint32_t heads = 0;
  uint32_t feed_forward = 0;
};

// A seed, how it was sampled, and the hash of the avatar's weights in fixed point (package.h,
// hash_weights), equal on every CPU.
struct GoldenSeed {
  uint64_t seed = 0;
  uint32_t steps = 0;
  SolverMethod method = SolverMethod::kDpmSolverPlusPlus2M;
  std::array<uint64_t, 2> hash{0, 0};
};

// A static group of sampled avatars. Its cells lie in patches, a token each: what is far apart on
// the body has little to do with each other.
struct SampledStaticGroup {
  uint32_t first_channel = 0, channels = 0;
  uint32_t grid_size = 0;
  std::span<const float> scale;      // [channels], as StaticGroup's
  std::span<const uint32_t> row;     // [M] of the group's values, each once, patch after patch
  std::vector<uint32_t> patch_rows;  // cells of every patch; their sum is M
};

// What all its avatars share: their kind, whose network is layers without weights unless it is
// everybody's, and traits, whose golden frame is pose and camera of a sampled avatar's, with no
// hash and no picture.
struct Sampler : AvatarKind, AvatarTraits {
  std::string name;
  uint32_t uv_size = 0;                           // as an avatar's
  bool antialiased = false;                       // all its avatars are
  std::vector<SampledStaticGroup> static_groups;  // empty: its avatars have no static part
  bool shares_network = false;                    // all its avatars have `network` and fixed_point
  FixedPointNetwork fixed_point;                  // then, of `values`; empty otherwise

  uint32_t texels_a_side() const { return uv_size != 0 ? uv_size : network.input_size; }  // T

  // All its avatars share these as well.
  uint32_t shape_count = 0;          // shape coefficients of an avatar; a token if any
  std::vector<Quantisation> values;  // [layers] of value 0 first, as FixedPointNetwork has them:
                                     // the training members' activation ranges
  PoseStatistics pose_statistics;    // of all training members together

  // The space of weights. Values of an avatar: per convolution its kernel (OHWI), then its bias;
  // then the shape coefficients; then patch after patch all channels of a cell, cell after cell.
  std::vector<uint32_t> ranks;             // [L] K_l, each at least 1
  std::span<const float> mean;             // [W]
  std::span<const int8_t> directions;      // token after token [K_l, values of the token]
  std::span<const float> direction_scale;  // [D] finite, may be 0

  // The denoiser. Matrices [rows,columns], row-major, one after the other:
  //   proj_l [d,K_l] for every token; time_in [d,d], time_out [d,d];
  //   per block: qkv [3d,d], attended [d,d], feed_in [f,d], feed_out [d,f];   unproj_l [K_l,d] for
  //   every token
  DenoiserShape denoiser;
  std::span<const int8_t> matrices;
  std::span<const float> row_scale;  // [R] > 0, normal
  std::span<const float> bias;       // [R]
  std::span<const float> position;   // [L+1,d] time first
  std::span<const float> norm;  // [2B+1,2,d] weight, then bias: per block before attention, before
                                // feed-forward; last before unproj

  // How it is sampled where nobody says otherwise.
  NoiseScheduleOptions noise;
  uint32_t steps = 20;
  SolverMethod method = SolverMethod::kDpmSolverPlusPlus2M;

  std::vector<GoldenSeed> golden_seeds;
  std::array<uint64_t, 2> population_hash{0,
                                          0};  // content hash of the population that it learnt from
  std::string_view report;  // JSON text of its evaluation (docs/generation.md); may be empty
};

// Values of the tokens, [L]: what a convolution's kernel and bias count together, then the shape
// coefficients, then the patches. The network's shapes must be valid (FIG_CHECK).
std::vector<size_t> sampler_token_sizes(const Sampler& sampler);

// Rows and columns of the denoiser's matrices, in their order.
struct MatrixShape {
  uint32_t rows = 0, columns = 0;
};
std::vector<MatrixShape> denoiser_matrices(const DenoiserShape& shape,
                                           std::span<const uint32_t> ranks);

}  // namespace figurine
