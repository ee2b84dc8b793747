// The seam between the rasterizer and its inner loop: plain structs, so that a kernel file needs nothing else and can be compiled with its
// own flags.
//
// The scalar kernel is the specification. One lane is one pixel in any later kernel: every lane then runs this same program, and results
// are equal to the bit.
#pragma once

#include <cstdint>

namespace figurine::kernels {

inline constexpr int32_t kTileSize = 32;  // pixels a side; a tile's state is 16 kB

// A projected Gaussian. With dx, dy the pixel centre minus the mean, in pixels:
//   u = (dx - slope dy) scale_u,   v = dy scale_v,   alpha = min(kAlphaMax, opacity 2^-(u^2 + v^2)).
// The scales hold the factor sqrt(log2(e) / 2). A sum of squares cannot turn positive, and a needle's terms do not cancel.
struct Splat {
  float mean_x, mean_y;    // pixels
  float slope;             // K = Sigma_xy / Sigma_yy
  float scale_u, scale_v;  // 1 / pixels
  float inverse_scale_u;   // pixels
  float reach;             // u^2 + v^2 <= reach wherever alpha reaches the cut; slightly more than log2(opacity / cut)
  float half_height;       // |dy| <= half_height there, pixels
  float opacity;
  float red, green, blue;
};

struct Pixel {
  float red, green, blue;  // premultiplied
  float transmittance;     // negative once the pixel has stopped; its absolute value is the transmittance
};

struct Tile {
  const Splat* splats;
  const uint32_t* order;  // [count] indices into splats, front to back
  uint32_t count;
  int32_t x, y;           // image coordinates of the first pixel
  int32_t width, height;  // pixels inside the image, at most kTileSize
  float alpha_cut;
  Pixel* pixels;  // [height, kTileSize], the caller sets them to 0, 0, 0, 1
};

// Blends the tile's splats into its pixels. Returns the number of contributions blended.
uint64_t blend_tile_scalar(const Tile& tile);

}  // namespace figurine::kernels
