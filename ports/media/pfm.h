// PFM, the portable float map: float32 images without loss, for comparing renderers.
//
// Header "Pf" (grey), "PF" (RGB) or "PF4" (RGBA), a newline, "WIDTH HEIGHT", a newline, the scale
// "-1.0" (its sign says little-endian), a newline, then rows from the bottom up. "PF4" is the
// four-channel extension that ImageMagick and others read; the original format knows grey and RGB
// alone.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/media/image.h"

namespace figurine::ports {

Result<std::vector<std::byte>> encode_pfm(const ImageF32& image);
// Both byte orders. kCorrupt if the header or the length is not what the format says.
Result<ImageF32> decode_pfm(std::span<const std::byte> bytes, const std::string& name);

}  // namespace figurine::ports
