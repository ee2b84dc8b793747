#include "toolchain/capture/sequence.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "toolchain/error.h"
#include "toolchain/random/counter.h"

namespace figurine::capture {

using random::CounterRandom;

namespace {

// Turns from one pose to the next. Not the golden ratio: its multiples of 13 nearly close the
// circle, so every 13th pose (the held-out ones) would face the same way; 13 times this one does
// not.
constexpr double kHeadingStep = 0.4142135623730950;  // sqrt(2) - 1
constexpr uint64_t kHeadingStream = 3;

}  // namespace

std::vector<CapturedPose> make_sequence(const std::vector<ports::MotionClip>& motions,
                                        const SequenceOptions& options) {
  uint32_t total = 0;
  for (const ports::MotionClip& motion : motions) total += motion.frame_count;
  if (total < options.frames) {
    throw InputError("--frames: " + std::to_string(options.frames) +
                     " asked for, the motions have " + std::to_string(total));
  }
  const dataset::Split split = dataset::default_split(options.frames, 1);
  const auto first =
      std::find(split.frames.begin(), split.frames.end(), dataset::FrameSplit::kBlock);
  const bool has_block = first != split.frames.end();
  const uint32_t spare = total - options.frames;
  const uint32_t distance = has_block ? std::min({kBlockDistance, total / 10, spare / 2}) : 0;
  const uint32_t length = total - 2 * distance;  // without the two gaps

  const double start = CounterRandom(options.seed, kHeadingStream).unit(0);
  std::vector<CapturedPose> sequence;
  double block_heading = 0;
  bool after_block = false;
  for (uint32_t i = 0; i < options.frames; ++i) {
    const bool in_block = split.frames[i] == dataset::FrameSplit::kBlock;
    uint32_t at = options.frames > 1
                      ? static_cast<uint32_t>(uint64_t{i} * (length - 1) / (options.frames - 1))
                      : 0;
    if (in_block) {
      if (!after_block) block_heading = start + i * kHeadingStep;
      after_block = true;
      at += distance;
    } else if (after_block) {
      at += 2 * distance;
    }
    size_t clip = 0;
    while (at >= motions[clip].frame_count) at -= motions[clip++].frame_count;

    CapturedPose captured;
    captured.split = split.frames[i];
    captured.motion = motions[clip].name;
    captured.motion_frame = at;
    const double turns = in_block ? block_heading : start + i * kHeadingStep;
    captured.heading_rad = static_cast<float>((turns - std::floor(turns)) * 2 * std::numbers::pi);
    captured.pose = ports::turned(motions[clip].pose(at), captured.heading_rad);
    captured.pose.root_translation_m[0] = -options.root_rest_m[0];
    captured.pose.root_translation_m[2] = -options.root_rest_m[2];
    sequence.push_back(std::move(captured));
  }
  return sequence;
}

}  // namespace figurine::capture
