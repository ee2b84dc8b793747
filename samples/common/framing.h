// Where the camera stands when nobody says so: far enough that what is drawn fits, and following a
// figure that walks.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "figurine/camera.h"

namespace figurine::samples {

using Point = std::array<float, 3>;

struct FramingOptions {
  // Share of the points that the picture must hold. Figures: nearly all. Captured scenes trail off
  // into a background that no picture can hold.
  double share = 0.998;
  double margin = 0.08;  // of the half image, left free on each side
};

// The smallest distance of an orbit around its target at which the share of points lies inside the
// image. Points that are not finite are left out; without any point the distance stays as it is.
float fit_distance_m(std::span<const Point> points, const OrbitCamera& orbit, double aspect,
                     const FramingOptions& options = {});

// The middle of the box between the quantiles (1 - share) / 2 and 1 - (1 - share) / 2 of each
// coordinate.
Point robust_centre(std::span<const Point> points, double share);

// A path of ground positions [x, z], smoothed so that a following camera does not bob with every
// step: at each frame the value of the line that fits its neighbours best under Gaussian weights of
// the given standard deviation (in frames). A line, not a mean: at the ends, where neighbours are
// on one side only, a mean would lag behind a figure that walks. Based on: Cleveland, Robust
// Locally Weighted Regression and Smoothing Scatterplots, 1979 (without robustness).
std::vector<std::array<float, 2>> smooth_path(std::span<const std::array<float, 2>> path,
                                              double sigma_frames);

}  // namespace figurine::samples
