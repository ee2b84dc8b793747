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

enum class DifferenceCoding : uint8_t { kInt8, kHalf };
const char* to_string(DifferenceCoding coding);  // "q8", "f16"

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

  std::span<const float> shape;  // [M,S]
  std::span<const float> bias;   // [M,R]
  std::span<const float> scale;  // [M,R] of kInt8
  std::span<const int16_t>
      frequency;                  // [C,255] of q in a convolution of any member, in units of 2^-14
  std::span<const uint8_t> code;  // the members' streams of q, one after the other: W values each
  std::span<const uint32_t> code_end;   // [M] where a member's stream ends
  std::span<const Half> difference;     // [M,W] of kHalf
  std::span<const float> pose_mean;     // [M,3P]
  std::span<const Half> pose_factor;    // [M,3P(3P+1)/2] rows of the lower triangle L
  std::span<const float> golden_poses;  // [M,J,4]

  size_t size() const { return members.size(); }
};

// Bytes that a member's differences take (scales, stream or halves, bias).
uint64_t difference_bytes(const Population& population, size_t member);

// Floats of storage that a member needs.
size_t member_floats(const Population& population);

// Member `member` as an avatar, in float alone. Its weights and its covariance are written to the
// storage, [member_floats], everything else points into the package: both must outlive the view.
// Never fails on a population that a package opened with; a millisecond at `edge`.
Avatar open_member(const Population& population, size_t member, std::span<float> storage);

// The covariance of a member's training poses, L L^T summed in double, symmetric to the bit.
// covariance: [3P,3P].
void pose_covariance(const Population& population, size_t member, std::span<float> covariance);

// A member by its name, or if none is called so by its number, counted from 0.
std::optional<size_t> find_member(const Population& population, std::string_view name_or_number);

}  // namespace figurine
