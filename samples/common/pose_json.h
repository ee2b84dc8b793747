// A pose as text: a JSON file for `figurine render --pose`, or a line of a stream for `figurine
// live --pose -`. docs/poses.md has the table of its fields.
//
//   {"root_translation_m": [0, 0.02, 0],
//    "joints": {"left_elbow": [0.92, 0, 0.39, 0], "neck": [0.2, 0, 0]}}
//
// Four numbers are a quaternion, wxyz; three are an axis times the angle in radians. A joint that
// is not named is at rest.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/pose.h"
#include "figurine/status.h"

namespace figurine::samples {

// A pose that owns its rotations.
struct StoredPose {
  std::array<float, 3> root_translation_m{0, 0, 0};
  std::vector<float> rotations;  // [J,4] wxyz, as they were given: not made unit length
  PoseView view() const { return {root_translation_m, rotations}; }
};

// All joints unturned, the root in its place.
StoredPose rest_pose(size_t joint_count);

// Reads text for a body of these joints. kInvalidArgument, one line behind `where`, for text that
// is no JSON, a field or a joint that there is none of (with the nearest names), a key that comes
// twice, another count of numbers, a number that is none or beyond a float, a quaternion of no
// length, a translation beyond kFarthestRoot_m.
Result<StoredPose> parse_pose_json(std::string_view text, std::span<const std::string> joint_names,
                                   const std::string& where);
inline constexpr double kFarthestRoot_m = 1e4;

// The same from a file. A package in its place is named as what it is.
Result<StoredPose> load_pose_json(const std::string& path,
                                  std::span<const std::string> joint_names);

// The text that reads back to the same floats, a joint on a line; joints at rest are written too,
// as names to edit. The counts must agree (FIG_CHECK).
std::string write_pose_json(const PoseView& pose, std::span<const std::string> joint_names);

}  // namespace figurine::samples
