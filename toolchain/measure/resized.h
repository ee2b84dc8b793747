// Pictures at another size: what a picture that was drawn at one distance looks like as one of
// another, without what a nearer or farther look would show.
#pragma once

#include "toolchain/measure/metrics.h"

namespace figurine::measure {

// Along each side by itself: bilinear between pixel centres, edges repeated, where it grows or
// stays; the mean of what every new pixel covers where it shrinks. Premultiplied values, rounded to
// the nearest. Sides must not be 0.
Picture resized(const Picture& picture, uint32_t width_px, uint32_t height_px);

}  // namespace figurine::measure
