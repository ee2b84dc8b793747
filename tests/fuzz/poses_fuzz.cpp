// Any text as a pose in JSON: refused in one line, or a pose that a body takes, which written and
// read again is the same. Seeds: tests/fuzz/seeds/poses.
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "samples/common/pose_json.h"

namespace {

void check(bool sound) {
  if (!sound) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine;
  static const std::vector<std::string> names = {"pelvis", "neck", "left_elbow", "right_elbow"};
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const Result<samples::StoredPose> pose = samples::parse_pose_json(text, names, "fuzz.json");
  if (!pose.ok()) {
    check(pose.status().message().starts_with("fuzz.json"));
    check(pose.status().message().find('\n') == std::string::npos);
    return 0;
  }
  check(validate_pose(pose->view(), static_cast<uint32_t>(names.size())).ok());
  const Result<samples::StoredPose> again =
      samples::parse_pose_json(samples::write_pose_json(pose->view(), names), names, "again.json");
  check(again.ok() && again->rotations == pose->rotations &&
        again->root_translation_m == pose->root_translation_m);
  return 0;
}
