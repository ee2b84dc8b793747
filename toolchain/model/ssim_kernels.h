// The inner loops of SSIM, one tile of 64 columns at a time; compiled once per instruction set
// (ssim_kernels.inc), like the splatter's.
#pragma once

#include <stdint.h>

namespace figurine::model {

inline constexpr uint32_t kSsimTaps = 11;
inline constexpr uint32_t kSsimRadius = 5;
inline constexpr uint32_t kSsimTileColumns = 64;
inline constexpr uint32_t kSsimTileRows = 128;

template <class Scalar>
struct SsimTile {
  const Scalar *x, *y;       // planes [height,width]
  uint32_t width, height;    // of the planes
  uint32_t column, row;      // first pixel of the tile
  uint32_t columns, rows;    // pixels of the tile, at most kSsimTileColumns x kSsimTileRows
  Scalar window[kSsimTaps];  // 1-D weights, sum 1
  Scalar c1, c2;
  Scalar* gradient;  // plane of the same size, or null: scale d(sum of SSIM over the whole
                     // plane)/dx is written at the tile's pixels
  Scalar scale;
};

template <class Scalar>
struct SsimKernels {
  Scalar (*tile)(const SsimTile<Scalar>& tile);  // the sum of SSIM over the tile's pixels
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
