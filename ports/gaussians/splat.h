// .splat files: 32 bytes a Gaussian and nothing else. Position and scale (linear) as six floats,
// then bytes: red, green, blue and opacity, and the rotation wxyz as 128 + 128 q. There is no
// header, no spherical harmonics and no word on how to draw them. Based on: Kwok, splat (the web
// viewer that has introduced the layout), 2023.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

// kCorrupt if the size is no multiple of 32 bytes, or nothing in the file can be drawn: without a
// header, that is how another kind of file shows.
Result<GaussianCloud> read_splat(std::span<const std::byte> bytes, const std::string& name);

}  // namespace figurine::ports
