// YUV4MPEG2 (.y4m): uncompressed video that every encoder and most players read.
//
// Layout 4:2:0 with chroma in the middle of each 2x2 block ("C420jpeg"), limited range, by the
// arithmetic of figurine/ycbcr.h. The format has no field for the matrix, so the choice follows
// what players assume: BT.601 up to 576 rows, BT.709 above. Chroma is that of the block's mean; odd
// sizes repeat the last row or column.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/media/image.h"

namespace figurine::ports {

// Frames a second as the exact fraction that video headers want: 30 -> 30/1, 29.97 ->
// 30000/1001, 12.5 -> 25/2.
struct FrameRate {
  uint32_t numerator = 30;
  uint32_t denominator = 1;
};
// kInvalidArgument unless 0.01 <= frames_per_second <= 1000.
Result<FrameRate> make_frame_rate(double frames_per_second);

// "YUV4MPEG2 W.. H.. F..:.. Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n"
std::string y4m_header(uint32_t width_px, uint32_t height_px, FrameRate rate);

// "FRAME\n" and the three planes Y [h,w], Cb and Cr [ceil(h/2),ceil(w/2)] of an RGB image (3
// channels), appended to out.
void append_y4m_frame(const ImageU8& image, std::vector<std::byte>& out);

}  // namespace figurine::ports
