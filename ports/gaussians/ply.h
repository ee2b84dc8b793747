// Files of 3D Gaussians in the .ply layout of the original 3DGS, which every viewer of the field
// reads: reading in all the varieties found in the wild, writing in the plain one.
//
// Properties of the element "vertex": x y z, f_dc_0..2 (or red green blue), f_rest_0..(3 (d+1)^2 -
// 4) channel-major (all red, then green, then blue) or none, opacity (a logit), scale_0..2 (natural
// logarithms; one: the same along all axes, two: a disc), rot_0..3 (wxyz, any length), filter_3D;
// nx ny nz and anything else are skipped. docs/formats.md has the whole list. Based on: Kerbl et
// al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023 (reference code); Yu et
// al., Mip-Splatting, 2024 (filter_3D); Huang et al., 2D Gaussian Splatting, 2024 (two scales).
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/gaussian.h"
#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

// Any ascii or binary .ply of either byte order, the compressed ones (compressed_ply.h) included:
// properties of any numeric type in any order, lists among them, other elements before or after the
// vertices. Gaussians with a word that is no number, a value that is not finite, an overflowing
// scale or a line of another length are left out and counted; an infinite opacity logit is opacity
// 0 or 1. kCorrupt names what the header or the data lacks. Memory is bounded by a multiple of the
// file's size.
Result<GaussianCloud> read_gaussian_ply(std::span<const std::byte> bytes, const std::string& name);

struct PlyWriting {
  std::vector<std::string> comments;        // lines of the header, each without a line end
  std::array<double, 3> origin_m{0, 0, 0};  // added to the positions
};

// Binary little-endian: x y z nx ny nz f_dc f_rest opacity scale rot, 14 + 3 (d+1)^2 floats (62 for
// degree 3); with an origin x y z are doubles. Scales and rotation are the singular values and left
// singular vectors of the covariance factors (decompose.h); opacities 0 and 1 become logits of -16
// and +16, a vanishing scale exp(-30).
std::vector<std::byte> write_gaussian_ply(const GaussianView& gaussians,
                                          const PlyWriting& writing = {});

// The comments that say how a scene is to be drawn, in the spelling that other readers know too.
// What up was assumed to be is not said.
std::vector<std::string> drawing_comments(bool antialiased, std::optional<UpAxis> up);

}  // namespace figurine::ports
