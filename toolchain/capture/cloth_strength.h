// Where a garment may fold and how much.
#pragma once

#include <vector>

#include "toolchain/capture/mesh.h"

namespace figurine::capture {

// [V] 0 .. 1: nothing at open borders (cuffs, hems, collars are sewn double), full `fade_m` away
// from them; nothing on parts smaller than a hand's length (buttons, belts, ties) and where head,
// hands and feet carry the vertex.
std::vector<float> cloth_strength(const Mesh& mesh, float fade_m = 0.035f);

}  // namespace figurine::capture
