// Makes an endless gait out of a few captured steps: finds the two most alike moments of a clip,
// closes the gap between them, and repeats.
//
// Short captures turn and stop. The slow part of the heading is taken out, so that the figure walks
// straight along +z, or on the spot. Based on: Kovar, Gleicher, Pighin, Motion Graphs, 2002,
// section 3 (alike moments), with joint angles and their rates as the distance.
#pragma once

#include <cstdint>

#include "ports/motion/motion_clip.h"

namespace figurine::ports {

struct LoopOptions {
  uint32_t cycles = 4;
  float shortest_s = 0.8f;  // a gait cycle, two steps
  float longest_s = 1.6f;
  bool in_place = false;  // the root stays over its rest place and only sways
};

struct LoopReport {
  uint32_t first_frame = 0;  // of the clip
  uint32_t length = 0;       // frames of one cycle
  float gap_rad =
      0;  // root mean square over joints of the rotation that was spread over the cycle to close it
};

// The last frame is followed by the first: playing the result in a loop is seamless (along +z: up
// to the path). kInvalidArgument if the clip is shorter than the longest of one cycle found and a
// margin of two frames.
Result<MotionClip> make_loop(const MotionClip& clip, const LoopOptions& options,
                             LoopReport* report = nullptr);

}  // namespace figurine::ports
