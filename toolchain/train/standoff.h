// Hair, skirts and shoes that stand off the skin: a pull from what the picture leaves uncovered.
//
// A Gaussian gets a gradient from pixels that it touches, a few millimetres to two centimetres
// around it. What stands further off is seen by none, and nothing is drawn to it. Here every pixel
// of the mask that the picture leaves uncovered pulls the Gaussian whose centre is nearest in the
// image towards the pixel's ray; neighbours take over as it leaves, until the mask is covered. A
// picture that covers its mask pulls nothing, so there is nothing to find out about a person
// beforehand, and limbs that touch do not matter. One image says nothing of depth; the other
// cameras do.
//
// Based on: the one-sided Chamfer distance of Fan et al., A Point Set Generation Network, 2017,
// between pixels and Gaussians, in the manner of silhouette fitting of Loper and Black, OpenDR,
// 2014.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/camera.h"
#include "toolchain/model/head.h"
#include "toolchain/model/splatter.h"

namespace figurine::train {

struct StandoffOptions {
  float weight = 4;        // of a pixel that is uncovered, beside the picture's L1
  float reach_m = 0.012f;  // nearer Gaussians have a gradient of their own
  float soft_m = 0.02f;    // beyond reach_m + soft_m the pull is constant
  float unit_m = 0.05f;    // a distance that costs a whole pixel: HeadDecoding::offset_scale_m
  float smallest_uncovered = 0.25f;  // of mask - alpha: antialiased edges do not pull
};

// One picture beside its truth. Borrowed.
struct StandoffView {
  const Camera* camera = nullptr;
  model::PixelRect crop;
  const float* alpha = nullptr;  // [h,w] of the crop, rendered
  const float* mask = nullptr;   // [h,w]
};

// Returns the loss, the sum over uncovered pixels of weight (mask - alpha) rho(distance of ray and
// nearest centre) / (unit pixels of the crop), and adds its gradient times `scale`; alpha and the
// choice of the nearest count as constants. position_m, gradient: [N,3], world. The same for any
// number of threads.
double standoff_loss(const StandoffView& view, std::span<const float> position_m,
                     const StandoffOptions& options, double scale, std::span<double> gradient);

// Adds dL/dh = offset_scale A^T dL/dcentre to the offsets of a head's gradient, [N,channels].
// Texels of gradient zero are not touched.
void add_offset_gradient(const model::HeadFrame& frame, std::span<const double> position_gradient,
                         float* head_gradient);

// The weight's share left when `progress` of the budget is used up: whole at first, none in the
// second half, where images decide alone.
double standoff_fade(double progress);

}  // namespace figurine::train
