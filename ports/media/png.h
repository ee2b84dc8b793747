// PNG, 8 bits a channel, through libpng's simplified interface: bytes in memory, no files
// (ports/host/files.h writes them atomically).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/media/image.h"

namespace figurine::ports {

// Grey, RGB or RGBA by the image's channels; marked as sRGB. The same pixels give the same bytes.
// kInvalidArgument if the image is not sound.
Result<std::vector<std::byte>> encode_png(const ImageU8& image);

// Any PNG, brought to 8 bits: grey stays 1 channel, colour 3, anything with alpha becomes 4. name
// appears in messages. kCorrupt on broken bytes, kLimitExceeded beyond 16384 pixels a side.
//
// Values are stored values: 16 bits are rounded to 8, whatever light libpng takes them for.
Result<ImageU8> decode_png(std::span<const std::byte> bytes, const std::string& name);

struct PngSize {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
};
// Width and height from the header alone.
Result<PngSize> decode_png_size(std::span<const std::byte> bytes, const std::string& name);

}  // namespace figurine::ports
