// The seam between the rasterizer and its inner loop: plain structs, so that a kernel file needs
// nothing else and can be compiled with its own flags.
//
// The scalar kernel is the specification. One lane is one pixel in any other kernel: every lane
// then runs this same program, and results are equal to the bit.
#pragma once

#include <cstdint>

namespace figurine::kernels {

inline constexpr int32_t kTileSize = 32;  // pixels a side
inline constexpr int32_t kTilePixels = kTileSize * kTileSize;

// A projected Gaussian. With dx, dy the pixel centre minus the mean, in pixels:
//   u = (dx - slope dy) scale_u,   v = dy scale_v,   alpha = min(kAlphaMax, opacity 2^-(u^2 +
//   v^2)).
// The scales hold the factor sqrt(log2(e) / 2). A sum of squares cannot turn positive, and a
// needle's terms do not cancel.
struct Splat {
  float mean_x, mean_y;    // pixels
  float slope;             // K = Sigma_xy / Sigma_yy
  float scale_u, scale_v;  // 1 / pixels
  float inverse_scale_u;   // pixels
  float reach;  // u^2 + v^2 < reach wherever alpha reaches the cut: more than log2(opacity / cut),
                // by a slack far above rounding
  float half_height;  // |dy| < half_height there, pixels
  float opacity;
  float red, green, blue;
};

// A tile's state in planes, [kTileSize, kTileSize] each; 16 kB. Colours are premultiplied. A
// transmittance turns negative when its pixel stops; its absolute value stays the transmittance.
struct TilePixels {
  alignas(64) float red[kTilePixels];
  alignas(64) float green[kTilePixels];
  alignas(64) float blue[kTilePixels];
  alignas(64) float transmittance[kTilePixels];
};

struct Tile {
  const Splat* splats;
  const uint32_t* order;  // [count] indices into splats, front to back
  uint32_t count;
  int32_t x, y;           // image coordinates of the first pixel
  int32_t width, height;  // pixels inside the image, at most kTileSize
  float alpha_cut;
  TilePixels* pixels;  // written whole
};

// Clears the tile and blends its splats. Returns the number of contributions blended into pixels of
// the image.
uint64_t blend_tile_scalar(const Tile& tile);

}  // namespace figurine::kernels
