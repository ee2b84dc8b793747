// What the fuzzers of clips share: a body to move them onto, and what must hold of the result.
#pragma once

#include <cmath>
#include <cstdlib>

#include "ports/motion/motion_files.h"

namespace figurine::ports::tests {

inline void check(bool sound) {
  if (!sound) std::abort();
}

// One line that begins with the file's name, or a motion that a package takes. Of a body without
// texels, whose soles cost more than all the rest.
inline void read_and_use(std::span<const std::byte> bytes, ClipKind kind,
                         const RetargetOptions& options = {}) {
  static const figurine::Body body = [] {
    figurine::Body joints = shipped_body();
    joints.texel = {};
    return joints;
  }();
  RetargetReport report;
  const Result<MotionClip> clip = read_clip(bytes, "fuzz", kind, body, options, &report);
  if (!clip.ok()) {
    check(clip.status().message().starts_with("fuzz"));
    check(clip.status().message().find('\n') == std::string::npos);
    return;
  }
  check(!report.summary.empty() && report.summary.find('\n') == std::string::npos);
  check(clip->frame_count > 0);
  check(clip->root_translation_m.size() == 3 * size_t{clip->frame_count});
  check(clip->rotations.size() == 4 * kJointCount * size_t{clip->frame_count});
  for (const float value : clip->root_translation_m) check(std::isfinite(value));
  for (size_t i = 0; i < clip->rotations.size(); i += 4) {
    float square = 0;
    for (size_t k = 0; k < 4; ++k) square += clip->rotations[i + k] * clip->rotations[i + k];
    check(std::abs(square - 1) < 1e-4f);
  }
}

}  // namespace figurine::ports::tests
