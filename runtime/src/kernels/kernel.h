// The seam between the runtime and its inner loops: plain structs, so that a kernel's file needs
// nothing else and can be compiled with flags of its own.
//
// A kernel's file includes this header, intrinsics and, inside its anonymous namespace,
// kernel_math.inc. It defines one function, named as its row in kernels.inc says, and nothing else
// with a name that a linker sees: an inline function of a shared header, compiled for AVX2, could
// become everybody's copy at link time (scripts/check_symbols looks).
//
// The baseline kernel of an operation is its specification. In any other a lane runs the same
// program for its own Gaussian, texel or pixel, so results are equal to the bit.
#pragma once

#include <stdint.h>

namespace figurine::kernels {

// Gaussians and texels travel in blocks, in planes: one array a quantity, one lane a Gaussian.
constexpr uint32_t kLanes = 16;
constexpr uint32_t kInfluences = 8;    // joints of a texel
constexpr uint32_t kMapPlanes = 6;     // position 3, normal 3
constexpr uint32_t kMaxShValues = 48;  // (3 + 1)^2 coefficients of red, green and blue
constexpr uint32_t kShapeValues = 11;  // of a head: offset 3, log-scale 3, quaternion 4, opacity
constexpr uint32_t kTaps = 4;          // heads of a coarser network around a texel

constexpr int32_t kTileSize = 32;  // pixels a side
constexpr int32_t kTilePixels = kTileSize * kTileSize;

// The constants of splatting (figurine/gaussian.h says what they mean; table.cpp that they agree).
constexpr float kDilationPx2 = 0.3f, kAntialiasedDilationPx2 = 0.1f;
constexpr float kAlphaMax = 0.99f;
constexpr float kTransmittanceStop = 1e-4f;
constexpr float kShOffset = 0.5f;
constexpr float kHalfColour = 1.7724538509f;  // of a static part (figurine/avatar.h)

// What a body says of a block of its texels. Lanes behind a body's last texel repeat it.
struct alignas(64) TexelBlock {
  float mean_position_m[3][kLanes];  // of the mean template
  float mean_normal[3][kLanes];
  float weight[kInfluences][kLanes];
  uint8_t joint[kInfluences][kLanes];
};

// Where an avatar's Gaussians sit before anything moves, and how large one of scale 1 is.
struct alignas(64) CanonicalBlock {
  float position_m[3][kLanes];
  float extent_m[kLanes];
};

// The blended skinning transforms of a block's texels. A rotation does not depend on where joints
// rest, so the mean template and the avatar's own share the linear part.
struct alignas(64) TransformBlock {
  float linear[9][kLanes];  // row-major [3,3]
  float mean_translation_m[3][kLanes];
  float own_translation_m[3][kLanes];
};

// Which heads of a coarser network a block's texels lie between, and their weights: a texel's head
// is (w0 y0 + w1 y1) + (w2 y2 + w3 y3) (figurine/texel_grid.h).
struct alignas(64) TapBlock {
  uint32_t row[kTaps][kLanes];  // of covered cells
  float weight[kTaps][kLanes];
};

// What the pose does not change of a block's Gaussians (figurine/avatar.h, StaticPart).
struct alignas(64) StaticBlock {
  float sum[kShapeValues][kLanes];  // s, added
  float gain[3][kLanes];            // e^s of red, green and blue
};

// How small a block's Gaussians may be (figurine/avatar.h, SmallestExtents).
struct alignas(64) ExtentBlock {
  float smallest_m[kLanes];  // s, 0: as they are
};

// World-space Gaussians, as figurine::GaussianView has them.
struct alignas(64) GaussianBlock {
  float position_m[3][kLanes];
  float factor[9][kLanes];  // row-major F, covariance F F^T
  float opacity[kLanes];
  float sh[kMaxShValues][kLanes];  // [(d + 1)^2, 3], the rest unused
};

// sum over k of w_k B_k, for k rising; influences of weight 0 are not read.
struct BlendTransformsJob {
  const TexelBlock* texels;
  const float* mean_from_rest;  // [J,12] row-major [3,4] skinning transforms of the mean template
  const float* own_from_rest;   // [J,12] of the avatar's own; differs in the translations alone
  TransformBlock* transforms;
};
using BlendTransforms = void(const BlendTransformsJob& job);

// Standardised position (less the root's) and normal of the mean template.
struct PoseMapsJob {
  const TexelBlock* texels;
  const TransformBlock* transforms;
  float root_m[3];
  float mean[kMapPlanes], scale[kMapPlanes];
  float (*maps)[kLanes];  // [kMapPlanes]
};
using PoseMaps = void(const PoseMapsJob& job);

// A network's heads and the static part to Gaussians in the world (figurine/avatar.h, StaticPart
// and HeadDecoding).
struct DecodeSkinJob {
  // Outputs: offset 3, log-scale 3, quaternion 4, opacity, SH. A lane's are head[0][lane], without
  // arithmetic; or, with taps, those of the four heads weighted.
  const float* head[kTaps][kLanes];
  const TapBlock* taps;            // null: the first row of heads is all there is
  const StaticBlock* static_part;  // null: none
  const ExtentBlock* smallest;     // null: none
  const CanonicalBlock* texels;
  const TransformBlock* transforms;
  float offset_scale_m, max_offset, max_log_scale, opacity_bias;  // an infinite bound is none
  uint32_t sh_values;                                             // 3 (d + 1)^2
  GaussianBlock* gaussians;
};
using DecodeSkin = void(const DecodeSkinJob& job);

// What projection needs of a camera, computed once a frame.
struct View {
  float view_from_world[12];
  float camera_centre_m[3];
  float fx_px, fy_px, cx_px, cy_px, near_m;
  float tan_x_min, tan_x_max, tan_y_min, tan_y_max;  // range of x/z and y/z in the Jacobian
  uint32_t width_px, height_px;
  float alpha_cut;
};

// A projected Gaussian: one cache line. With dx, dy the pixel centre minus the mean, in pixels:
//   u = (dx - slope dy) scale_u,   v = dy scale_v,   alpha = min(kAlphaMax, opacity 2^-(u^2 + v^2))
// The scales hold the factor sqrt(log2(e) / 2). A sum of squares cannot turn positive, and a
// needle's terms do not cancel.
struct alignas(64) Splat {
  float mean_x, mean_y;    // pixels
  float slope;             // K = Sigma_xy / Sigma_yy
  float scale_u, scale_v;  // 1 / pixels
  float inverse_scale_u;   // pixels
  // u^2 + v^2 < reach wherever alpha reaches the cut: more than log2(opacity / cut), by a slack far
  // above rounding. |dy| < half_height there, pixels.
  float reach, half_height;
  float opacity;
  float red, green, blue;
  // Where along y the ellipse is widest to the right (dy of that point), and the tiles that its box
  // touches, ends included.
  float widest_dy_px;
  uint16_t tile_x_begin, tile_y_begin, tile_x_last, tile_y_last;
};
static_assert(sizeof(Splat) == 64);

// Which Gaussians are left out before anything is computed for them that nobody would see.
enum ProjectLeaveOut : uint32_t {
  kLeaveOutTransparent = 1,  // opacity, as splatted, below the cut: no pixel would take it
  kLeaveOutOutside = 2,      // the box misses the image
};

struct ProjectJob {
  const View* view;
  const GaussianBlock* gaussians;
  uint32_t count;  // lanes that hold a Gaussian, 1 to kLanes
  uint32_t sh_degree;
  uint32_t leave_out;    // ProjectLeaveOut
  uint32_t antialiased;  // 1: another dilation, and the opacity makes up for it (SplatOptions)
  Splat* splats;         // [kLanes], filled where visible
  float* depth_m;        // [kLanes], filled where visible
};

// One bit a lane. A lane that is in none is behind the near plane or not finite.
struct ProjectedLanes {
  uint32_t visible, transparent, outside;
};
using ProjectBlock = ProjectedLanes(const ProjectJob& job);

// A tile's state in planes, [kTileSize, kTileSize] each; 16 kB. Colours are premultiplied. A
// transmittance turns negative when its pixel stops; its absolute value stays the transmittance.
struct TilePixels {
  alignas(64) float red[kTilePixels];
  alignas(64) float green[kTilePixels];
  alignas(64) float blue[kTilePixels];
  alignas(64) float transmittance[kTilePixels];
};

struct BlendTileJob {
  const Splat* splats;
  const uint32_t* order;  // [count] indices into splats, front to back
  uint32_t count;
  int32_t x, y;           // image coordinates of the first pixel
  int32_t width, height;  // pixels inside the image, at most kTileSize
  float alpha_cut;
  uint32_t
      leave_out_stopped;  // 1: look now and then whether every pixel has stopped, and end there
  TilePixels* pixels;     // written whole
};

struct BlendedTile {
  uint64_t contributions;  // blended into pixels of the image
  uint32_t splats;         // looked at before the tile had stopped
};
// Clears the tile and blends its splats.
using BlendTile = BlendedTile(const BlendTileJob& job);
// The same by the fast tier (figurine/frame.h, Approximation): near the baseline, which is the
// exact one, and not equal to it.
struct FastTier {};
using BlendTileFast = BlendedTile(const BlendTileJob& job, FastTier tier);

enum ResolveFormat : uint32_t {
  kResolveRgba8,    // rounded to nearest and clamped to [0,1]; NaN is 0
  kResolveRgbaF32,  // neither
};

// Rows of a blended tile to straight colour and alpha, or to colour over a background.
struct ResolveRowsJob {
  const TilePixels* pixels;
  int32_t first_row, rows, width;  // of the tile
  const float* background;         // [3], or null
  ResolveFormat format;
  uint8_t* out;  // the first row's first pixel
  uint64_t stride_bytes;
};
using ResolveRows = void(const ResolveRowsJob& job);

// sums[i] += shared . rows[i], rows `length` apart, exact: the caller says that no sum overflows.
// Integer sums have no order, so any kernel gives the same bits.
constexpr uint32_t kDotsAtOnce = 4;   // count is a multiple of it
constexpr uint32_t kDotMultiple = 8;  // length is a multiple of it, padded by zeros
struct AddDotsJob {
  const int16_t* shared;  // [length], aligned to 16 bytes as the rows are
  const int16_t* rows;    // [count,length]
  uint64_t length, count;
  int32_t* sums;  // [count]
};
using AddDots = void(const AddDotsJob& job);

}  // namespace figurine::kernels
