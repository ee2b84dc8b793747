// YUV4MPEG2 (.y4m): uncompressed video that every encoder and most players read.
//
// Layout 4:2:0 with chroma in the middle of each 2x2 block ("C420jpeg"), limited range. The format
// has no field for the matrix, so the choice follows what players assume: BT.601 up to 576 rows,
// BT.709 above. With R'G'B' in [0,1] as stored (no transfer function is applied):
//   Y' = Kr R' + (1 - Kr - Kb) G' + Kb B',   Cb = (B' - Y') / (2 (1 - Kb)),   Cr = (R' - Y') / (2
//       (1 - Kr)),
//   codes: round(16 + 219 Y'), round(128 + 224 Cb), round(128 + 224 Cr);   BT.601: Kr 0.299, Kb
//       0.114; BT.709: Kr 0.2126, Kb 0.0722.
// Chroma is the mean over the block's pixels; odd sizes repeat the last row or column. Based on:
// ITU-R BT.601-7 and BT.709-6, section 3.
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
