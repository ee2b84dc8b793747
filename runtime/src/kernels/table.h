// Which function runs which operation on this machine, chosen once by instruction set.
#pragma once

#include "figurine/isa.h"
#include "figurine/status.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

// One function an operation; none is null.
struct KernelTable {
  Isa isa;
  kernels::BlendTransforms* blend_transforms;
  kernels::PoseMaps* pose_maps;
  kernels::DecodeSkin* decode_skin;
  kernels::ProjectBlock* project_block;
  kernels::BlendTile* blend_tile;
  kernels::BlendTileFast* blend_tile_fast;
  kernels::ResolveRows* resolve_rows;
  kernels::AddDots* add_dots;
};

// The table of an instruction set; it lives as long as the program. kUnsupported if this build has
// no kernel of it or this CPU cannot run it.
Result<const KernelTable*> kernels_for(Isa isa);
// That of the largest instruction set supported here.
const KernelTable& best_kernels();

}  // namespace figurine
