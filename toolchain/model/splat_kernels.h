// The inner loops of the splatter: one tile of 32x32 pixels at a time, compiled once per
// instruction set (splat_kernels.inc).
//
// Plain structs only: an inline function of a shared header that was compiled for AVX-512 could
// become the baseline build's copy at link time.
#pragma once

#include <stdint.h>

namespace figurine::model {

inline constexpr uint32_t kTileSize = 32;    // pixels a side
inline constexpr uint32_t kBlockSize = 4;    // pixels a side of a block: 16 lanes, row-major
inline constexpr uint32_t kTileBlocks = 64;  // bit 8 row + column of a mask
inline constexpr uint32_t kBlockPixels = 16;
inline constexpr uint32_t kPairSums = 9;

// One projected Gaussian. alpha(x,y) = min(0.99, 2^(log2_opacity - (p t^2 + q dy^2))), t = dx - k
// dy: a sum of squares, so needles do not cancel.
template <class Scalar>
struct SplatRecord {
  Scalar mean_x, mean_y;  // pixels, absolute in the image
  Scalar p, k, q;         // p and q include log2(e)
  Scalar log2_opacity;
  Scalar red, green, blue;
};

struct SplatPair {
  uint32_t gaussian;
  uint32_t unused;
  uint64_t blocks;  // in: blocks that the ellipse touches; after forward_tile: those that it
                    // reached before they were full
};

// Sums over pixels of one (Gaussian, tile) pair; s = alpha dL/dalpha = dL/dpower.
enum PairSum : uint32_t {
  kSumS,
  kSumST,
  kSumSY,
  kSumSTT,
  kSumSTY,
  kSumSYY,
  kSumRed,
  kSumGreen,
  kSumBlue
};

template <class Scalar>
struct TileJob {
  uint32_t x, y;           // first pixel of the tile in the image
  uint32_t width, height;  // pixels of the tile inside the crop, 1 to 32
  Scalar alpha_cut;
  const SplatRecord<Scalar>* records;
  SplatPair* pairs;  // [count] front to back
  uint32_t count;
  uint64_t plane;  // scalars from one plane of the image to the next
  uint64_t row;    // scalars from one row to the next
};

template <class Scalar>
struct SplatKernels {
  // Fills pairs[].blocks. Conservative: a block that holds a pixel with alpha >= cut is never
  // missed.
  void (*find_blocks)(const TileJob<Scalar>& job);
  // Blends the tile. image points at the tile's first pixel. Returns the number of block
  // evaluations.
  uint64_t (*forward_tile)(const TileJob<Scalar>& job, Scalar* image);
  // sums: [count, kPairSums].
  void (*backward_tile)(const TileJob<Scalar>& job, const Scalar* image,
                        const Scalar* image_gradient, Scalar* sums);
  const char* name;
};

namespace generic {
extern const SplatKernels<float> kFloatKernels;
extern const SplatKernels<double> kDoubleKernels;
}  // namespace generic
#ifdef FIGURINE_X86_KERNELS
namespace avx2 {
extern const SplatKernels<float> kFloatKernels;
}
namespace avx512 {
extern const SplatKernels<float> kFloatKernels;
}
#endif

}  // namespace figurine::model
