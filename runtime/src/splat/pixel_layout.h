// How each pixel format lies in memory, and how rows of RGBA8 codes become rows of it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "figurine/camera.h"
#include "figurine/frame.h"

namespace figurine {

struct PixelLayout {
  size_t bytes_per_pixel = 0;  // of the first plane; 0: no such format
  bool alpha = false;          // without it a picture needs a background
  uint32_t columns = 1;        // the width is a multiple of it,
  uint32_t rows = 1;           // the height of that: pixels that share chroma
};
PixelLayout layout_of(PixelFormat format);

// Whether a picture of the camera's size can be written to the target. kInvalidArgument names the
// field. A background is the frame's business: layout_of(...).alpha.
Status validate_target(const ImageTarget& target, const Camera& camera);

// Writes width pixels of row y from column x on, and of row y + 1 if rows is 2; of formats of bytes
// but kRgba8 itself. codes: RGBA8, its rows stride_bytes apart. x, y and width are multiples of
// what the layout says, and where that is 2 for rows there are 2.
void pack_rows(const uint8_t* codes, size_t stride_bytes, uint32_t x, uint32_t y, uint32_t width,
               uint32_t rows, const ImageTarget& target);

}  // namespace figurine
