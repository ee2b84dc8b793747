// JPEG, 8-bit RGB: bytes in memory, no files. Values are stored (sRGB-encoded) values. The only
// includer of libjpeg.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/media/image.h"

namespace figurine::ports {

struct JpegSize {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
};

// Three channels, whatever the file has, upright as its EXIF says. name appears in messages.
// kCorrupt for what is no JPEG, or one that libjpeg can only decode with warnings (cut off, corrupt
// segments); kLimitExceeded beyond 16384 pixels a side; kUnsupported for CMYK.
Result<ImageU8> decode_jpeg(std::span<const std::byte> bytes, const std::string& name);

// Width and height from the header alone; upright, too.
Result<JpegSize> decode_jpeg_size(std::span<const std::byte> bytes, const std::string& name);

// RGB; chroma at full resolution (4:4:4), optimised Huffman tables. quality 1 to 100. The same
// pixels give the same bytes. kInvalidArgument unless the image is sound and has three channels;
// kOutOfMemory.
Result<std::vector<std::byte>> encode_jpeg(const ImageU8& image, int quality);

}  // namespace figurine::ports
