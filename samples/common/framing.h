// Where the camera stands when nobody says so: far enough that what is drawn fits, and following a
// figure that walks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "figurine/status.h"

namespace figurine::samples {

using Point = std::array<float, 3>;

// What of the figures a picture shall hold: everything, head and shoulders, or the head.
enum class Framing : uint8_t { kBody, kBust, kHead };
Result<Framing> parse_framing(const std::string& text);  // "body", "bust", "head"

// Which of the body's joints move that part, by the names of SMPL-X's joints that there are. Not
// for kBody. kUnsupported if the body has no joint called "head".
Result<std::vector<uint8_t>> framed_joints(const Body& body, Framing framing);

// Whether one of the joints moves a texel most. joints: of framed_joints.
bool moved_most_by(const Body& body, uint32_t texel, std::span<const uint8_t> joints);

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

// A path of positions, smoothed so that a following camera does not bob with every
// step: at each frame the value of the line that fits its neighbours best under Gaussian weights of
// the given standard deviation (in frames). A line, not a mean: at the ends, where neighbours are
// on one side only, a mean would lag behind a figure that walks. Based on: Cleveland, Robust
// Locally Weighted Regression and Smoothing Scatterplots, 1979 (without robustness).
std::vector<Point> smooth_path(std::span<const Point> path, double sigma_frames);

}  // namespace figurine::samples
