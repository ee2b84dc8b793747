// Rows of RGB pixels as rows of YCbCr, in the layouts that video files and cameras take. Limited
// range, by the arithmetic of figurine/ycbcr.h; a row at a time, so that neither side needs a whole
// picture in memory and rows may have any stride.
//
// Where pixels share chroma it is that of their mean: of two neighbours in 4:2:2, of a 2x2 block in
// 4:2:0. Spans must have the sizes named (FIG_CHECK).
#pragma once

#include <cstdint>
#include <span>

#include "figurine/ycbcr.h"

namespace figurine::ports {

// rgb [W,3] -> luma [W].
void luma_row(std::span<const uint8_t> rgb, YcbcrMatrix matrix, std::span<uint8_t> luma);

// 4:2:0, planes apart (I420, y4m): top and bottom [W,3] -> cb and cr [ceil(W/2)] each. An odd last
// column counts twice; for an odd last row give it as top and as bottom.
void chroma_row(std::span<const uint8_t> top, std::span<const uint8_t> bottom, YcbcrMatrix matrix,
                std::span<uint8_t> cb, std::span<uint8_t> cr);

// 4:2:0, Cb and Cr in turn (the second plane of NV12): -> cbcr [ceil(W/2),2].
void interleaved_chroma_row(std::span<const uint8_t> top, std::span<const uint8_t> bottom,
                            YcbcrMatrix matrix, std::span<uint8_t> cbcr);

// 4:2:2, Y Cb Y Cr in turn (YUYV, also called YUY2): rgb [W,3] -> yuyv [W,2]; W is even.
void yuyv_row(std::span<const uint8_t> rgb, YcbcrMatrix matrix, std::span<uint8_t> yuyv);

}  // namespace figurine::ports
