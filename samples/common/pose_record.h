// A pose as bytes (docs/poses.md, "Records"): for programs that send many, without text between
// their floats and ours. Little-endian:
//
//   0   4 bytes    8F 50 4F 53, "\x8FPOS": no text begins so
//   4   u32        bytes behind this field: 16 + 16 J
//   8   u16        version, 1
//   10  u16        J, joints of the body, in its order
//   12  f32[3]     root_translation_m
//   24  f32[J,4]   rotations, wxyz
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "samples/common/pose_json.h"

namespace figurine::samples {

inline constexpr std::string_view kPoseRecordMagic = "\x8FPOS";
inline constexpr size_t kPoseRecordHead = 8;  // magic and length
inline constexpr size_t kMostPoseRecord = kPoseRecordHead + 16 + 16 * size_t{kMaxJoints};

// How many bytes the record at the front of text has, its head included; of a text shorter than the
// head: kPoseRecordHead. None: there is no record, nor the beginning of one.
std::optional<size_t> pose_record_bytes(std::string_view text);

// A whole record, for a body of so many joints. kUnsupported for another version, kInvalidArgument
// for another number of joints or bytes, a value that is not finite, a quaternion of no length, a
// translation beyond kFarthestRoot_m; one line behind `where`.
Result<StoredPose> parse_pose_record(std::string_view record, size_t joint_count,
                                     const std::string& where);

// At most kMaxJoints (FIG_CHECK).
std::vector<std::byte> write_pose_record(const PoseView& pose);

}  // namespace figurine::samples
