// What every reader of this folder returns: Gaussians that own their arrays, where the file has
// them, and what the file says of how to draw them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "figurine/gaussian.h"

namespace figurine::ports {

// Which of a file's axes points up.
enum class UpAxis : uint8_t { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };
const char* to_string(UpAxis axis);                            // "+y"
std::optional<UpAxis> parse_up_axis(const std::string& text);  // of the same words

// Files that say nothing are taken to be y-down: the axes of COLMAP and of the original 3DGS, which
// converters to other containers keep.
inline constexpr UpAxis kAssumedUp = UpAxis::kMinusY;

struct GaussianCloud {
  uint32_t sh_degree = 0;
  std::vector<float> position_m;         // [n,3] the file's positions minus origin_m
  std::vector<float> covariance_factor;  // [n,9] R S
  std::vector<float> opacity;            // [n] in [0,1]
  std::vector<float> sh;                 // [n,(d+1)^2,3]

  // Whole numbers near the middle of the Gaussians, subtracted in double where that is far from
  // zero; else zero. Cameras in the file's coordinates move with it.
  std::array<double, 3> origin_m{0, 0, 0};
  uint64_t left_out = 0;     // of the file: what cannot be drawn
  std::string left_out_why;  // the first of them: "vertex 12: opacity is no number"

  std::string container;             // "ply", "compressed ply", "splat", "spz 3"
  std::optional<UpAxis> up;          // if the file says so
  bool antialiased = false;          // to be drawn so, as the file says
  std::vector<std::string> remarks;  // what was fused, taken for granted or skipped, in a few words

  uint32_t count() const { return static_cast<uint32_t>(opacity.size()); }
  UpAxis up_axis() const { return up.value_or(kAssumedUp); }
  GaussianView view() const {
    return {count(), sh_degree, position_m, covariance_factor, opacity, sh};
  }
};

// What was read, in one line without a line end: "441 Gaussians of degree 0 (ply), up -y
// (assumed)"; where they differ from nothing also what was left out and why, the origin, and the
// remarks.
std::string describe(const GaussianCloud& cloud);

}  // namespace figurine::ports
