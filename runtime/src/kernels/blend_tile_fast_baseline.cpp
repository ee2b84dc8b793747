// Without lanes the fast tier of the blend is the exact one.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {

BlendTile blend_tile_baseline;

BlendedTile blend_tile_fast_baseline(const BlendTileJob& job, FastTier) {
  return blend_tile_baseline(job);
}

}  // namespace figurine::kernels
