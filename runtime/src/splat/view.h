// What projection needs of a camera, computed once a frame.
#pragma once

#include "figurine/camera.h"
#include "runtime/src/kernels/kernel.h"

namespace figurine {

// The camera must be valid, alpha_cut in (0, 0.5].
kernels::View make_view(const Camera& camera, float alpha_cut);

}  // namespace figurine
