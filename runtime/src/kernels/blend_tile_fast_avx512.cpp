// The fast tier of the blend in blocks.
#include <immintrin.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_x86.inc"

#include "runtime/src/kernels/lanes_avx512.inc"

#include "runtime/src/kernels/blend_blocks.inc"

}  // namespace

BlendedTile blend_tile_fast_avx512(const BlendTileJob& job, FastTier) {
  return blend_tile_in_blocks<true>(job);
}

}  // namespace figurine::kernels
