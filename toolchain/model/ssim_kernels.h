// The inner loops of SSIM, one tile of 64 columns at a time; compiled once per instruction set (ssim_kernels.inc), like the splatter's.
#pragma once

#include <stdint.h>

namespace figurine::model {

inline constexpr uint32_t kSsimTaps = 11;
inline constexpr uint32_t kSsimRadius = 5;
inline constexpr uint32_t kSsimTileColumns = 64;
inline constexpr uint32_t kSsimTileRows = 96;

template <class Scalar>
struct SsimTile {
  const Scalar *x, *y;       // planes [height,width]
  uint32_t width, height;    // of the planes
  uint32_t column, row;      // first pixel of the tile
  uint32_t columns, rows;    // pixels of the tile, at most kSsimTileColumns x kSsimTileRows
  Scalar window[kSsimTaps];  // 1-D weights, sum 1
  Scalar c1, c2;
  // d(SSIM of a pixel)/d(mean of x, mean of x^2, mean of xy) there, planes of the same size; written forward, read backward.
  Scalar *d_mean, *d_square, *d_cross;
};

template <class Scalar>
struct SsimKernels {
  Scalar (*forward_tile)(const SsimTile<Scalar>& tile);  // the sum of SSIM over the tile's pixels
  // gradient = scale d(sum of SSIM)/dx over the tile's pixels; reads the derivative planes around the tile.
  void (*backward_tile)(const SsimTile<Scalar>& tile, Scalar scale, Scalar* gradient);
};

namespace generic {
extern const SsimKernels<float> kFloatSsimKernels;
extern const SsimKernels<double> kDoubleSsimKernels;
}  // namespace generic
#ifdef FIGURINE_X86_KERNELS
namespace avx2 {
extern const SsimKernels<float> kFloatSsimKernels;
}
namespace avx512 {
extern const SsimKernels<float> kFloatSsimKernels;
}
#endif

}  // namespace figurine::model
