// Which frames of a motion are shown when: --frames, --fps and --turntable of figurine render.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "figurine/status.h"

namespace figurine::samples {

struct ShownFrames {
  std::vector<uint32_t> frames;  // of the motion, in the order in which they are shown
  double frames_per_second = 30;
  std::string note;  // where frames are left out or repeated: in words
};

// What of the chosen frames, which follow each other at rate_hz, is shown fps times a second in
// real time: to each moment the frame that has begun last. Without fps each once.
ShownFrames frames_in_time(const std::vector<uint32_t>& chosen, double rate_hz,
                           std::optional<double> fps);

// count frames that play the chosen ones in real time, from the start again where those end.
ShownFrames turntable_frames(const std::vector<uint32_t>& chosen, double rate_hz,
                             std::optional<double> fps, uint32_t count);

}  // namespace figurine::samples
