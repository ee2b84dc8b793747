// A frame in memory, as the renderer wrote it.
#pragma once

#include "figurine/renderer.h"
#include "ports/media/image.h"
#include "samples/common/parse.h"

namespace figurine::samples {

// RGBA with straight alpha, in one of two forms: 8 bits a channel, or float.
struct RenderedFrame {
  ports::ImageU8 u8;
  ports::ImageF32 f32;
  PixelFormat format;

  RenderedFrame(ImageSize size, PixelFormat pixel_format);
  ImageTarget target();
};

// Red, green and blue without alpha.
ports::ImageU8 drop_alpha(const ports::ImageU8& rgba);
ports::ImageF32 drop_alpha(const ports::ImageF32& rgba);

}  // namespace figurine::samples
