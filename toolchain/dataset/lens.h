// What a lens bends: Brown and Conrady's distortion as OpenCV states it, and pictures without it.
//
//   x = X / Z, y = Y / Z, r2 = x^2 + y^2
//   radial = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
//   x' = x radial + 2 p1 x y + p2 (r2 + 2 x^2)      u = fx x' + cx
//   y' = y radial + p1 (r2 + 2 y^2) + 2 p2 x y      v = fy y' + cy
//
// OpenCV's u, v, cx and cy count from the middle of the first pixel, figurine's from its corner
// (docs/numerics.md): half a pixel more. Here a Camera is figurine's.
//
// Based on: D. C. Brown, Close-range camera calibration, 1971; OpenCV, calib3d.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/camera.h"
#include "ports/media/image.h"

namespace figurine::dataset {

struct Lens {
  std::array<double, 8> k{};  // in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6
  bool bends() const;
};

// values: as files have them: none, 4, 5 or 8 numbers; 12 or 14 (thin prism, tilt) where what
// follows the first 8 is zero. Throws InputError "where: reason" on another count, and on a number
// beyond +-100.
Lens make_lens(const std::vector<double>& values, const std::string& where);

// Where the lens puts what a camera without one would see at (x, y), both as tangents.
std::array<double, 2> distort(const Lens& lens, double x, double y);

// The distorted image [H,W,channels] as a pinhole camera of the same intrinsics and size would have
// taken it: bilinear; black where the lens saw nothing. channels as given.
ports::ImageU8 undistort(const ports::ImageU8& image, const Camera& camera, const Lens& lens);

// Whether the distortion grows with the distance from the middle all over the image, as that of a
// real lens does; where it folds back, the coefficients are not those of this image.
bool is_one_to_one(const Camera& camera, const Lens& lens);

}  // namespace figurine::dataset
