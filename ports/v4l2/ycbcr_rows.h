// Rows of a camera's YCbCr as rows of RGB. By a matrix, in limited or full range; chroma is that of
// the pixels that share it, not interpolated. Integers: within one code of the real numbers.
// Based on: ITU-R BT.601-7 and BT.709-6, section 3; JFIF 1.02 for the full range.
#pragma once

#include <cstdint>

#include "figurine/ycbcr.h"

namespace figurine::ports {

class YcbcrRows {
 public:
  YcbcrRows(YcbcrMatrix matrix, bool full_range);

  // Y Cb Y Cr in turn -> rgb [width,3]; an odd last pixel has a whole group of four bytes.
  void yuyv(const uint8_t* from, uint32_t width, uint8_t* rgb) const;
  // A row of Y and its row of Cb Cr in turn -> rgb [width,3].
  void nv12(const uint8_t* luma, const uint8_t* chroma, uint32_t width, uint8_t* rgb) const;

 private:
  void pixel(int luma, int cb, int cr, uint8_t* rgb) const;

  // In 1/65536: of luma, of Cr in red and green, of Cb in green and blue.
  int luma_, red_cr_, green_cr_, green_cb_, blue_cb_;
  int black_;  // code of no light
};

}  // namespace figurine::ports
