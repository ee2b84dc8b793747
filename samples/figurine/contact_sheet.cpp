#include "samples/figurine/contact_sheet.h"

#include <algorithm>

#include "samples/common/file_sink.h"

namespace figurine::samples {

namespace {

// Mean of a block of pixels with straight alpha: colours count by their alpha.
void average_block(const ports::ImageU8& image, uint32_t x0, uint32_t y0, uint32_t side,
                   uint8_t* out) {
  uint64_t alpha = 0, colour[3] = {0, 0, 0};
  for (uint32_t y = y0; y < y0 + side; ++y) {
    for (uint32_t x = x0; x < x0 + side; ++x) {
      const uint8_t* pixel = image.at(x, y);
      alpha += pixel[3];
      for (int c = 0; c < 3; ++c) colour[c] += uint64_t(pixel[c]) * pixel[3];
    }
  }
  const uint64_t pixels = uint64_t(side) * side;
  for (int c = 0; c < 3; ++c)
    out[c] = static_cast<uint8_t>(alpha == 0 ? 0 : (colour[c] + alpha / 2) / alpha);
  out[3] = static_cast<uint8_t>((alpha + pixels / 2) / pixels);
}

}  // namespace

Result<ContactSheet> ContactSheet::create(const Options& options) {
  Options sound = options;
  sound.tiles = std::min(options.tiles, options.frame_count);
  sound.columns = std::min(options.columns, sound.tiles);
  if (sound.tiles < 1 || sound.columns < 1)
    return Status(StatusCode::kInvalidArgument,
                  "contact sheet: needs at least one tile and one column");
  if (options.shrink < 1 ||
      options.shrink > std::min(options.frame_size.width_px, options.frame_size.height_px)) {
    return Status(StatusCode::kInvalidArgument,
                  "contact sheet: shrink must be within 1 and the frame's smaller side");
  }
  const ImageSize tile{options.frame_size.width_px / options.shrink,
                       options.frame_size.height_px / options.shrink};
  const uint64_t rows = (sound.tiles + sound.columns - 1) / sound.columns;
  if (uint64_t(sound.columns) * tile.width_px > 16384 || rows * tile.height_px > 16384) {
    return Status(
        StatusCode::kInvalidArgument,
        "contact sheet: larger than 16384 pixels a side; use fewer tiles or a larger shrink");
  }
  return ContactSheet(sound, tile);
}

ContactSheet::ContactSheet(const Options& options, ImageSize tile)
    : options_(options),
      tile_(tile),
      sheet_(options.columns * tile.width_px,
             (options.tiles + options.columns - 1) / options.columns * tile.height_px, 4) {}

void ContactSheet::offer(uint32_t index, const ports::ImageU8& frame) {
  for (uint32_t t = 0; t < options_.tiles; ++t) {
    const uint64_t chosen =
        options_.tiles == 1
            ? 0
            : (uint64_t(t) * (options_.frame_count - 1) + (options_.tiles - 1) / 2) /
                  (options_.tiles - 1);
    if (chosen != index) continue;
    const uint32_t left = t % options_.columns * tile_.width_px,
                   top = t / options_.columns * tile_.height_px;
    for (uint32_t y = 0; y < tile_.height_px; ++y) {
      for (uint32_t x = 0; x < tile_.width_px; ++x) {
        average_block(frame, x * options_.shrink, y * options_.shrink, options_.shrink,
                      sheet_.at(left + x, top + y));
      }
    }
  }
}

Status ContactSheet::write(const std::string& path, bool opaque) const {
  return write_picture(path, sheet_, opaque);
}

}  // namespace figurine::samples
