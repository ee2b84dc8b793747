// Files of 3D Gaussians in the .ply layout of the original 3DGS, which every viewer of the field
// reads: reading in all the varieties found in the wild, writing in the plain one.
//
// Properties of the element "vertex": x y z, f_dc_0..2, f_rest_0..(3 (d+1)^2 - 4) channel-major
// (all red, then green, then blue) or none, opacity (a logit), scale_0..2 (natural logarithms),
// rot_0..3 (wxyz, any length); nx ny nz and anything else are ignored. Based on: Kerbl et al., 3D
// Gaussian Splatting for Real-Time Radiance Field Rendering, 2023 (reference code); Turk, The PLY
// Polygon File Format, 1994.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/gaussian.h"
#include "figurine/status.h"

namespace figurine::ports {

// Gaussians that own their arrays, laid out as GaussianView wants them.
struct GaussianCloud {
  uint32_t sh_degree = 0;
  std::vector<float> position_m;         // [n,3]
  std::vector<float> covariance_factor;  // [n,9] R S
  std::vector<float> opacity;            // [n] in [0,1]
  std::vector<float> sh;                 // [n,(d+1)^2,3]
  uint64_t left_out = 0;                 // of the file: not finite, or without a rotation

  uint32_t count() const { return static_cast<uint32_t>(opacity.size()); }
  GaussianView view() const {
    return {count(), sh_degree, position_m, covariance_factor, opacity, sh};
  }
};

// Any ascii or binary .ply of either byte order: properties of any numeric type in any order, other
// elements before or after the vertices, f_rest of degree 0 to 3 or absent, infinite opacity
// logits. Gaussians with a value that is not finite, an overflowing scale or a zero rotation are
// left out and counted. kCorrupt names what the header or the data lacks, kUnsupported compressed
// files and higher degrees. Memory is bounded by the file's size.
Result<GaussianCloud> read_gaussian_ply(std::span<const std::byte> bytes, const std::string& name);

// Binary little-endian: x y z nx ny nz f_dc f_rest opacity scale rot, 14 + 3 (d+1)^2 floats (62 for
// degree 3). Scales and rotation are the singular values and left singular vectors of the
// covariance factors (decompose.h); opacities 0 and 1 become logits of -16 and +16, a vanishing
// scale exp(-30). comments: lines of the header, each without a line end, for people.
std::vector<std::byte> write_gaussian_ply(const GaussianView& gaussians,
                                          const std::vector<std::string>& comments = {});

}  // namespace figurine::ports
