// The blend, a pixel at a time: the specification of every other kernel.
//
// Per splat the exact span of its ellipse in every row, then per pixel alpha, the cut, the stop,
// the sum. The span only skips pixels that the cut would reject anyway (reach has slack above
// rounding), so neither it nor its widening to whole blocks shows in the picture. The pixel program
// has no branches and no two pixels share a sum, so a compiler may run several pixels at a time
// with the same bits (runtime/CMakeLists.txt lets it).
//
// Based on: Kerbl et al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023, eq. 3
// (front-to-back alpha blending) and its rasterizer's constants (figurine/gaussian.h).
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

constexpr int32_t kBlock = 4;  // spans are widened to multiples of it
static_assert(kTileSize % kBlock == 0);
constexpr uint32_t kSplatsPerCheck = 16;  // how often to look whether the whole tile has stopped
constexpr uint32_t kPrefetch = 4;         // splats ahead: a tile's are scattered over the frame's

// The rows of a splat's ellipse within a tile, indexed by row of the tile.
struct Spans {
  float centre[kTileSize];    // u = (x - centre) scale_u
  float v2[kTileSize];        // v^2
  int32_t begin[kTileSize];   // first pixel, rounded down to a block
  int32_t blocks[kTileSize];  // 0 or less where the row is empty
};

float clamp(float value, float low, float high) {
  value = value > low ? value : low;
  return value < high ? value : high;
}

// Rows and columns count from the tile's first pixel; row_y holds the rows' centres in the image,
// middle_left the image's x of column 0's centre.
void find_spans(const Splat& splat, const float* __restrict row_y, float middle_left, float width,
                int32_t y_begin, int32_t y_end, Spans& __restrict spans) {
  for (int32_t y = y_begin; y < y_end; ++y) {
    const float dy = row_y[y] - splat.mean_y;
    const float v = dy * splat.scale_v, v2 = v * v;
    const float room = splat.reach - v2;
    const float half_width = __builtin_sqrtf(room > 0 ? room : 0.0f) * splat.inverse_scale_u;
    const float centre = splat.mean_x + splat.slope * dy, middle = centre - middle_left;
    // A pixel centre exactly on a bound is beyond reach, so it may count as inside or outside.
    const int32_t begin = static_cast<int32_t>(clamp(middle - half_width + 1, 0, width)) & -kBlock;
    const int32_t end = static_cast<int32_t>(clamp(middle + half_width + 1, 0, width));
    spans.centre[y] = centre;
    spans.v2[y] = v2;
    spans.begin[y] = begin;
    spans.blocks[y] = (end - begin + kBlock - 1) / kBlock;
  }
}

// The pixel program, on the spans. Returns the number of contributions blended. Not inlined:
// inlined, GCC 14 loses __restrict and the vector loop.
[[gnu::noinline]] uint32_t blend_spans(const Splat& splat, const Spans& spans, int32_t y_begin,
                                       int32_t y_end, float alpha_cut,
                                       const float* __restrict column_x, float* __restrict red,
                                       float* __restrict green, float* __restrict blue,
                                       float* __restrict transmittance) {
  const float scale_u = splat.scale_u, opacity = splat.opacity;
  const float splat_red = splat.red, splat_green = splat.green, splat_blue = splat.blue;
  uint32_t blended = 0;
  for (int32_t y = y_begin; y < y_end; ++y) {
    const float centre = spans.centre[y], v2 = spans.v2[y];
    const int32_t begin = spans.begin[y], first = y * kTileSize + begin,
                  count = spans.blocks[y] * kBlock;
    for (int32_t i = 0; i < count; ++i) {
      const float u = (column_x[begin + i] - centre) * scale_u;
      const float weight = opacity * exp2_minus(u * u + v2);
      const float alpha = weight < kAlphaMax ? weight : kAlphaMax;
      // The light that meets the contribution: none where it is below the cut or the pixel has
      // stopped.
      const float before = transmittance[first + i];
      const float living = before > 0.0f ? before : 0.0f;
      const float light = weight >= alpha_cut ? living : 0.0f;
      const float after = light * (1.0f - alpha);
      const float share = after >= kTransmittanceStop ? light * alpha : 0.0f;
      red[first + i] += share * splat_red;
      green[first + i] += share * splat_green;
      blue[first + i] += share * splat_blue;
      // before - 2 light: -before where the pixel stops now, before where nothing met it.
      transmittance[first + i] = after >= kTransmittanceStop ? after : before - (light + light);
      blended += after >= kTransmittanceStop ? 1 : 0;
    }
  }
  return blended;
}

// Whether every pixel has stopped.
bool all_stopped(const TilePixels& pixels) {
  uint32_t living = 0;
  for (int32_t i = 0; i < kTilePixels; ++i) living += pixels.transmittance[i] > 0 ? 1 : 0;
  return living == 0;
}

void clear(const BlendTileJob& tile) {
  for (int32_t i = 0; i < kTilePixels; ++i) {
    tile.pixels->red[i] = tile.pixels->green[i] = tile.pixels->blue[i] = 0;
  }
  // Pixels outside the image are stopped from the start: blocks may touch them, counts may not.
  for (int32_t y = 0; y < kTileSize; ++y) {
    for (int32_t x = 0; x < kTileSize; ++x) {
      tile.pixels->transmittance[y * kTileSize + x] =
          y < tile.height && x < tile.width ? 1.0f : -1.0f;
    }
  }
}

}  // namespace

BlendedTile blend_tile_baseline(const BlendTileJob& tile) {
  clear(tile);
  TilePixels& pixels = *tile.pixels;
  const float left = static_cast<float>(tile.x), top = static_cast<float>(tile.y);
  const float width = static_cast<float>(tile.width), height = static_cast<float>(tile.height);
  Spans spans;
  float column_x[kTileSize], row_y[kTileSize];  // pixel centres in the image
  for (int32_t x = 0; x < kTileSize; ++x) column_x[x] = (left + static_cast<float>(x)) + 0.5f;
  for (int32_t y = 0; y < kTileSize; ++y) row_y[y] = (top + static_cast<float>(y)) + 0.5f;

  uint64_t blended = 0;
  uint32_t i = 0;
  for (; i < tile.count; ++i) {
    if (tile.leave_out_stopped != 0 && i % kSplatsPerCheck == kSplatsPerCheck - 1 &&
        all_stopped(pixels)) {
      break;
    }
    if (i + kPrefetch < tile.count) __builtin_prefetch(&tile.splats[tile.order[i + kPrefetch]]);
    const Splat splat = tile.splats[tile.order[i]];
    // Rows and columns relative to the tile, ends exclusive. A pixel centre exactly on a bound is
    // beyond reach: it may count as in or out.
    const float middle_y = splat.mean_y - 0.5f - top;
    const int32_t y_begin =
        static_cast<int32_t>(clamp(middle_y - splat.half_height + 1, 0, height));
    const int32_t y_end = static_cast<int32_t>(clamp(middle_y + splat.half_height + 1, 0, height));
    find_spans(splat, row_y, left + 0.5f, width, y_begin, y_end, spans);
    blended += blend_spans(splat, spans, y_begin, y_end, tile.alpha_cut, column_x, pixels.red,
                           pixels.green, pixels.blue, pixels.transmittance);
  }
  return {.contributions = blended, .splats = i};
}

}  // namespace figurine::kernels
