// The blend in blocks, four registers a block.
#include <arm_neon.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_neon.inc"

#include "runtime/src/kernels/blend_blocks.inc"

}  // namespace

BlendedTile blend_tile_neon(const BlendTileJob& job) { return blend_tile_in_blocks<false>(job); }

}  // namespace figurine::kernels
