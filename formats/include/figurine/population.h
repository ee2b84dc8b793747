// A population: many avatars of one network shape and one body, each as its difference to initial
// weights that all share. It is what a generator of avatars learns from; any member can be rendered
// from it.
//
// Letters: M members, C convolutions, R output channels of all convolutions together, W weights of
// all kernels together (biases not counted), S shape coefficients, P joints of the pose statistics,
// J joints. Kernels and channels lie in the order of the layers.
//
//   weight = initial + scale * q   (kInt8: q in [-127, 127], one scale an output channel, both
//                                  float operations rounded to nearest)
//   weight = initial + difference  (kHalf)
//   weight = initial               (kNone: the network is everybody's, biases included)
//
// Members may have a static part (figurine/avatar.h), all of the same groups. The population's own
// is their mean, and a member's integers are coded against it in the member's own scale: with m the
// mean's value at a cell and K channels of all groups together
//
//   q = wrap(d + clamp(round(m / scale), -127, 127))     round: to nearest, ties to even; wrap: by
//                                                        255 into [-127, 127]
//
// Biases, shape, decoding and statistics are stored as an avatar has them; the pose covariance is L
// L^T of a lower triangle in half floats, so it is positive definite whatever the rounding.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/detail/half.h"

namespace figurine {

inline constexpr uint32_t kMaxMembers = 1024;

enum class DifferenceCoding : uint8_t { kInt8, kHalf, kNone };
const char* to_string(DifferenceCoding coding);  // "q8", "f16", "none"

// Which part of the population learns from a member: weights, statistics and bases may come from
// kTrain alone.
enum class Split : uint8_t { kTrain, kValidation, kTest };
const char* to_string(Split split);  // "train", "validation", "test"

// Its golden frame is pose and camera; no picture and no hash.
struct PopulationMember : AvatarTraits {
  std::string name;
  Split split = Split::kTrain;
  std::vector<double> quality;  // one for each of quality_names, NaN where it was not measured
};

// The network's weights are the initial ones.
struct Population : AvatarKind {
  std::string name;
  DifferenceCoding coding = DifferenceCoding::kInt8;
  std::vector<std::string> quality_names;
  std::vector<PopulationMember> members;  // [M]
  std::vector<uint8_t> pose_joints;       // [P]; empty: no statistics
  uint32_t uv_size = 0;                   // as an avatar's
  bool antialiased = false;               // all members are
  StaticPart static_part;                 // the mean of the members'; empty: they have none

  std::span<const float> shape;  // [M,S]
  std::span<const float> bias;   // [M,R]
  std::span<const float> scale;  // [M,R] of kInt8
  std::span<const int16_t>
      frequency;                  // [C,255] of q in a convolution of any member, in units of 2^-14
  std::span<const uint8_t> code;  // the members' streams of q, one after the other: W values each
  std::span<const uint32_t> code_end;   // [M] where a member's stream ends
  std::span<const Half> difference;     // [M,W] of kHalf
  std::span<const float> static_scale;  // [M,K] group after group
  std::span<const int16_t>
      static_frequency;  // [K,255] of d in a channel of any member, in units of 2^-14
  std::span<const uint8_t> static_code;       // the members' streams of d, channel after channel
  std::span<const uint32_t> static_code_end;  // [M]
  std::span<const float> pose_mean;           // [M,3P]
  std::span<const Half> pose_factor;          // [M,3P(3P+1)/2] rows of the lower triangle L
  std::span<const float> golden_poses;        // [M,J,4]

  size_t size() const { return members.size(); }
  uint32_t texels_a_side() const { return uv_size != 0 ? uv_size : network.input_size; }  // T
};

// Bytes that a member's differences take (scales, streams or halves, bias).
uint64_t difference_bytes(const Population& population, size_t member);

// How a member's static integer follows from the mean's value m at its cell.
int8_t predict_static(float mean, float scale);          // clamp(round(m / scale), -127, 127)
int8_t add_static(int8_t predicted, int8_t difference);  // wrapped
int8_t subtract_static(int8_t value, int8_t predicted);  // the d that add_static undoes

// Floats of storage that a member needs.
size_t member_floats(const Population& population);

// Member `member` as an avatar, its network in float alone. Its weights, its covariance and its
// static integers are written to the storage, [member_floats], everything else points into the
// package: both must outlive the view.
// Never fails on a population that a package opened with; a millisecond at `edge`.
Avatar open_member(const Population& population, size_t member, std::span<float> storage);

// The covariance of a member's training poses, L L^T summed in double, symmetric to the bit.
// covariance: [3P,3P].
void pose_covariance(const Population& population, size_t member, std::span<float> covariance);

// A member by its name, or if none is called so by its number, counted from 0.
std::optional<size_t> find_member(const Population& population, std::string_view name_or_number);

}  // namespace figurine
