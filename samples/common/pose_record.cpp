#include "samples/common/pose_record.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "figurine/check.h"

namespace figurine::samples {

namespace {

static_assert(std::endian::native == std::endian::little, "records are little-endian");

constexpr uint16_t kRecordVersion = 1;
constexpr size_t kBeforeRotations = 24;

template <class T>
T field(std::string_view bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

Status no_record(const std::string& where, const std::string& what) {
  return Status(StatusCode::kInvalidArgument, where + ": " + what);
}

}  // namespace

std::optional<size_t> pose_record_bytes(std::string_view text) {
  const size_t known = std::min(text.size(), kPoseRecordMagic.size());
  if (known == 0 || text.substr(0, known) != kPoseRecordMagic.substr(0, known)) return std::nullopt;
  if (text.size() < kPoseRecordHead) return kPoseRecordHead;
  const size_t size = kPoseRecordHead + field<uint32_t>(text, 4);
  if (size < kBeforeRotations || size > kMostPoseRecord) return std::nullopt;
  return size;
}

Result<StoredPose> parse_pose_record(std::string_view record, size_t joint_count,
                                     const std::string& where) {
  if (pose_record_bytes(record) != record.size() || record.size() < kBeforeRotations)
    return no_record(where, "no pose record");
  const auto version = field<uint16_t>(record, 8), joints = field<uint16_t>(record, 10);
  if (version != kRecordVersion) {
    return Status(StatusCode::kUnsupported,
                  where + ": version " + std::to_string(version) + " is not known, 1 is");
  }
  if (joints != joint_count) {
    return no_record(
        where, std::to_string(joints) + " joints: the body has " + std::to_string(joint_count));
  }
  if (record.size() != kBeforeRotations + 16 * size_t{joints})
    return no_record(where, "its length is not that of " + std::to_string(joints) + " joints");
  StoredPose pose;
  for (size_t k = 0; k < 3; ++k) {
    pose.root_translation_m[k] = field<float>(record, 12 + 4 * k);
    if (!(std::abs(pose.root_translation_m[k]) <= kFarthestRoot_m))
      return no_record(where, "root_translation_m: not a number within 10000 metres");
  }
  pose.rotations.resize(4 * joint_count);
  std::memcpy(pose.rotations.data(), record.data() + kBeforeRotations, 16 * joint_count);
  const Status sound = validate_pose(pose.view(), static_cast<uint32_t>(joint_count));
  if (!sound.ok()) return sound.within(where);
  return pose;
}

std::vector<std::byte> write_pose_record(const PoseView& pose) {
  const size_t joints = pose.rotations.size() / 4;
  FIG_CHECK(joints <= kMaxJoints, "more joints than a body has");
  std::vector<std::byte> record(kBeforeRotations + 16 * joints);
  const auto length = static_cast<uint32_t>(record.size() - kPoseRecordHead);
  const uint16_t words[] = {kRecordVersion, static_cast<uint16_t>(joints)};
  std::memcpy(&record[0], kPoseRecordMagic.data(), kPoseRecordMagic.size());
  std::memcpy(&record[4], &length, sizeof(length));
  std::memcpy(&record[8], words, sizeof(words));
  std::memcpy(&record[12], pose.root_translation_m.data(), 12);
  if (joints > 0) std::memcpy(&record[kBeforeRotations], pose.rotations.data(), 16 * joints);
  return record;
}

}  // namespace figurine::samples
