// The small languages of figurine's command line: sizes, ranges, colours, places, frame names. Text
// in, value or one-line reason out; no files.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/status.h"

namespace figurine::samples {

struct ImageSize {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
};
Result<ImageSize> parse_size(std::string_view text);  // "512x384", 1 to 16384 a side

// Every step-th frame of [first, end). "12" is one frame, "10:40" frames 10 to 39, "10:40:4" every
// fourth of them, "10:" to the end, ":" all.
struct FrameRange {
  uint32_t first = 0;
  std::optional<uint32_t> end;
  uint32_t step = 1;
};
Result<FrameRange> parse_frames(std::string_view text);

// Opaque colour, or none for "alpha". "alpha", "black", "grey", "white", "#e0e4e8", or
// "0.9,0.9,0.9" with values in [0,1].
struct Background {
  std::optional<std::array<float, 3>> colour;
};
Result<Background> parse_background(std::string_view text);

// Where a figure stands: metres on the ground, degrees about the vertical (positive turns it to its
// left). "X,Z" or "X,Z,HEADING".
struct Placement {
  float x_m = 0;
  float z_m = 0;
  float heading_deg = 0;
};
Result<Placement> parse_placement(std::string_view text);

// A file name with one "%d" or "%04d" in it, for numbered images. Any other use of '%' is an error
// ("%%" is not known).
class NumberedName {
 public:
  static Result<NumberedName> parse(const std::string& text);
  bool numbered() const { return numbered_; }
  std::string name(uint32_t number) const;

 private:
  std::string before_, after_;
  bool numbered_ = false;
  uint32_t digits_ = 0;
};

// Comma-separated finite numbers; nothing on any other text. At most max_count of them.
std::optional<std::vector<double>> parse_numbers(std::string_view text, size_t max_count);

}  // namespace figurine::samples
