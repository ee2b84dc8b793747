// The blend in blocks, two registers a block.
#include <immintrin.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_x86.inc"

#include "runtime/src/kernels/lanes_avx2.inc"

#include "runtime/src/kernels/blend_blocks.inc"

}  // namespace

BlendedTile blend_tile_avx2(const BlendTileJob& job) { return blend_tile_in_blocks<false>(job); }

}  // namespace figurine::kernels
