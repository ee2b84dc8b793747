// Reads BVH motion capture files: joint hierarchies with Euler channels, and frames of channel
// values. For untrusted input.
//
// Read as people have them: keywords in any case, names with blanks, "Frames:12" without one, a
// byte order mark, tabs and line ends of any kind, several roots. A line of another number of
// values than there are channels is refused; frames that are missing at the end are said (`note`).
//
// Based on: the Biovision hierarchy as written down by Meredith and Maddock, Motion Capture File
// Formats Explained, 2001.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/status.h"

namespace figurine::ports {

enum class BvhChannel : uint8_t {
  kXPosition,
  kYPosition,
  kZPosition,
  kXRotation,
  kYRotation,
  kZRotation
};

struct BvhJoint {
  std::string name;
  int parent = -1;                        // parents come before children
  std::array<double, 3> offset{0, 0, 0};  // from the parent, in the file's unit
  std::vector<BvhChannel> channels;       // in file order: rotations multiply left to right
  size_t first_channel = 0;               // column of its first channel
  std::array<double, 3> end_offset{0, 0, 0};
  bool has_end = false;  // an End Site
};

struct Bvh {
  std::string where;  // the file, for messages
  std::vector<BvhJoint> joints;
  uint32_t frame_count = 0;
  double frame_time_s = 0;  // 0: the file says none that can be (what it says is in the note)
  size_t channel_count = 0;
  std::vector<float> values;  // [frame_count, channel_count] degrees and units
  std::string note;           // what the file lacks, in words; empty: nothing

  int find(const std::string& joint_name) const;  // -1 if there is none
};

// Limits: 1024 joints, 64 deep, 2^26 values, magnitudes to 1e6. A frame time outside 1 ms and 1 s
// is none. kCorrupt naming `where`, line and reason.
Result<Bvh> parse_bvh(std::string_view text, const std::string& where);

}  // namespace figurine::ports
