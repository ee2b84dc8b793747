// The fast tier of the blend in blocks.
#include <arm_neon.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_neon.inc"

#include "runtime/src/kernels/blend_blocks.inc"

}  // namespace

BlendedTile blend_tile_fast_neon(const BlendTileJob& job, FastTier) {
  return blend_tile_in_blocks<true>(job);
}

}  // namespace figurine::kernels
