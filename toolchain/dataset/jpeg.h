// JPEG, 8-bit RGB: bytes in memory, no files. Values are stored (sRGB-encoded) values. The only
// includer of libjpeg.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "ports/media/image.h"

namespace figurine::dataset {

inline constexpr uint32_t kMaxImageSide = 16384;

struct ImageSize {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
};

// Three channels, whatever the file has. Throws InputError naming `name`. A JPEG that libjpeg can
// only decode with warnings (cut off, corrupt segments) is damaged, not accepted.
ports::ImageU8 decode_jpeg(std::span<const std::byte> bytes, const std::string& name);

// Width and height from the header alone.
ImageSize decode_jpeg_size(std::span<const std::byte> bytes, const std::string& name);

// RGB; chroma at full resolution (4:4:4), optimised Huffman tables. quality 1 to 100. The same
// pixels give the same bytes.
std::vector<std::byte> encode_jpeg(const ports::ImageU8& image, int quality);

}  // namespace figurine::dataset
