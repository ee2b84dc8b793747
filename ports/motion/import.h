// The whole way from a clip to a motion, as the commands of both halves go it: options as text,
// reading, moving onto the body, loops, the head's pitch, provenance, and the line that says what
// came out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/package.h"
#include "figurine/status.h"
#include "ports/host/text_option.h"
#include "ports/motion/motion_clip.h"
#include "ports/motion/retarget.h"

namespace figurine::ports {

struct ImportSettings {
  std::string clip;  // the file
  RetargetOptions retarget;
  std::string map;           // a file of joint names; empty: none
  std::string source;        // provenance; empty: what clip_source() says
  uint32_t loop_cycles = 0;  // 0: as it is
  bool in_place = false;
  std::optional<float> head_pitch_deg;
};

// The options of the commands; they hold on to the settings.
std::vector<TextOption> import_options(ImportSettings& settings);

struct ImportedMotion {
  MotionClip clip;
  std::string summary;    // one line: frames, rate, axes, height, feet, bones
  Provenance provenance;  // without the tool
};

// The T-pose of a clip, as --neutral says it: "first", "zero", "axes" or a frame's number.
Status set_neutral(const std::string& text, RetargetOptions& options);
// What came out of read_clip(), in one line: frames, rate, feet, bones, head, and what was read.
std::string describe_motion(const RetargetReport& report, const MotionClip& clip);

// body_hash: of the body's package. Errors name the file and the reason.
Result<ImportedMotion> import_motion(const ImportSettings& settings, const figurine::Body& body,
                                     const std::array<uint64_t, 2>& body_hash);

}  // namespace figurine::ports
