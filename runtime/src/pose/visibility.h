// Which texels of a posed avatar a camera may see, before its network has said where their
// Gaussians lie.
//
// may_be_seen is conservative, from the bounds that the head's decoding has: a block is left out
// only where no Gaussian that its texels could hold would touch a pixel in projection's own
// arithmetic (kernels/project_block), rounding included. find_averted is not: it asks the surface.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "figurine/avatar.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/kernel.h"
#include "runtime/src/pose/transforms.h"

namespace figurine {

// Of every Gaussian of an avatar in its canonical pose.
struct GaussianBounds {
  float offset_m = 0;  // between texel and centre; infinite: there is no bound
  // The largest deviation: in units of CanonicalBlock::extent_m, and what may come to it.
  float extents = 0, widening_m = 0;
};
// largest_m: of the avatar's smallest extents (SmallestExtents); 0: it has none.
GaussianBounds bounds_of(const HeadDecoding& decoding, float largest_m = 0);

// Whether a block has a texel that may be seen.
bool may_be_seen(const kernels::CanonicalBlock& texels, const kernels::TransformBlock& transforms,
                 const GaussianBounds& bounds, const kernels::View& view);

// Which texels of a block face away from the camera, a bit a lane: the cosine between the line of
// sight and the posed normal is above this. The blended transform turns the normal as it would turn
// a vector, which where skin stretches is not quite where the surface faces.
uint32_t find_averted(const kernels::TexelBlock& body, const kernels::CanonicalBlock& texels,
                      const kernels::TransformBlock& transforms, const kernels::View& view,
                      float cosine);

// The smallest box in the image around points of a figure.
struct BoxInImage {
  float left_px = std::numeric_limits<float>::infinity(), right_px = -left_px;
  float top_px = left_px, bottom_px = -left_px;
  // The longer one; infinite if a point is not in front of the near plane, or nowhere.
  float side_px() const;
};

// Widens the box by a point [3] of the world; by a block's first texel: enough to tell how large a
// figure is.
void widen(const float* point, const kernels::View& view, BoxInImage& box);
void widen(const kernels::CanonicalBlock& texels, const kernels::TransformBlock& transforms,
           const kernels::View& view, BoxInImage& box);

}  // namespace figurine
