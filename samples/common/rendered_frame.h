// A frame in memory, as the renderer wrote it.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/frame.h"
#include "ports/media/image.h"
#include "samples/common/parse.h"

namespace figurine::samples {

// The pixels lie where their format belongs; the other two are empty.
struct RenderedFrame {
  ports::ImageU8 u8;    // kRgba8 (4 channels, straight alpha), kRgb24 (3)
  ports::ImageF32 f32;  // kRgbaF32
  std::vector<uint8_t>
      packed;  // others: rows without padding, kNv12's chroma right behind its luma
  PixelFormat format;
  ImageSize size;

  RenderedFrame(ImageSize size, PixelFormat pixel_format);
  ImageTarget target();
};

// Red, green and blue without alpha.
ports::ImageU8 drop_alpha(const ports::ImageU8& rgba);
ports::ImageF32 drop_alpha(const ports::ImageF32& rgba);

}  // namespace figurine::samples
