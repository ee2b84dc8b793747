// A layout as a picture: covered texels in the colour of their part, border texels pale, the rest
// white.
#pragma once

#include "ports/media/image.h"
#include "toolchain/body/atlas.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body {

// RGB, a whole number of pixels to a texel, at least 512 pixels a side. Blue body, red head, yellow
// arms, orange hands, violet legs, green feet; charts of one part differ in shade.
ports::ImageU8 draw_atlas(const Surface& surface, const TexelBody& texels);

}  // namespace figurine::body
