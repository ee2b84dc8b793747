// Where a figure looks: measured over a motion, and levelled. People who are captured watch their
// feet; whom one wants to see in the face looks ahead.
//
// Only pitch, by one rotation for the whole clip: nods and glances stay what they were.
#pragma once

#include "ports/motion/motion_clip.h"

namespace figurine::ports {

// Angle of the head's forward axis (+z at rest) over the horizontal, positive upwards.
struct HeadPitch {
  float mean_rad = 0, lowest_rad = 0, highest_rad = 0;  // over the clip's frames
};
HeadPitch measure_head_pitch(const MotionClip& clip);

// Turns neck and head about their own left-right axes, by the same angle each, until the clip's
// mean pitch is the wanted one to 0.1 degrees. kInvalidArgument if each would have to turn by more
// than kMostNeckTurn_rad: no neck does.
inline constexpr float kMostNeckTurn_rad = 0.7f;
Result<MotionClip> with_head_pitch(MotionClip clip, float mean_rad);

}  // namespace figurine::ports
