// SuperSplat's compressed .ply: 16 bytes a Gaussian, in chunks of 256 that share the ranges of
// their positions, scales and colours.
//
// Element "chunk": min_x .. max_z, min_scale_x .. max_scale_z (logarithms), and since 2024 min_r ..
// max_b, all floats. Element "vertex": packed_position (11, 10 and 11 bits from the top),
// packed_rotation (2 bits that name the largest component of wxyz, then the others in 10 bits
// each), packed_scale (11, 10, 11), packed_color (8 bits each: red, green, blue, opacity), all
// uint. Element "sh", if there is one: f_rest_0.. as uchar, channel-major, [-4, 4] in 256 steps.
// Based on: PlayCanvas, SuperSplat and splat-transform (the layout that they write).
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"
#include "ports/gaussians/ply_format.h"

namespace figurine::ports {

// bytes: the whole file, whose header has been parsed and has vertices with packed_position.
// kCorrupt names what is missing or contradicts itself; kUnsupported for ascii.
Result<GaussianCloud> read_compressed_ply(std::span<const std::byte> bytes, const PlyHeader& header,
                                          const std::string& name);

}  // namespace figurine::ports
