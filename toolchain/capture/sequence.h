// The poses of a capture: frames of motions, spread over their length and over all headings, with a
// held-out block kept apart.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "ports/motion/motion_clip.h"
#include "toolchain/dataset/dataset.h"

namespace figurine::capture {

struct CapturedPose {
  ports::OwnedPose pose;  // root joint over the origin (x = z = 0), its height as in the motion
  dataset::FrameSplit split = dataset::FrameSplit::kTrain;
  std::string motion;
  uint32_t motion_frame = 0;
  float heading_rad = 0;  // turn about the vertical, beside the motion's own
};

// Frames between the held-out block and the nearest pose outside it, where the motions are long
// enough (at most a tenth of them on each side).
inline constexpr uint32_t kBlockDistance = 40;

struct SequenceOptions {
  uint32_t frames = 119;
  uint64_t seed = 1;
  std::array<float, 3> root_rest_m{0, 0, 0};  // of the person's own shape
};

// The motions are laid end to end and sampled evenly; dataset::default_split says what is held out.
// Every pose outside the block gets its own heading (irrational steps: any run of poses covers the
// circle, and so do the held-out ones); the block keeps one, so that it is a piece of real motion.
// InputError if the motions have fewer frames than asked for.
std::vector<CapturedPose> make_sequence(const std::vector<ports::MotionClip>& motions,
                                        const SequenceOptions& options);

}  // namespace figurine::capture
