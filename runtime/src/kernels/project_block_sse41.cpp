// Projection in lanes, four Gaussians at once.
#include <immintrin.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_x86.inc"

#include "runtime/src/kernels/lanes_sse41.inc"

#include "runtime/src/kernels/projection_constants.inc"

#include "runtime/src/kernels/project_lanes.inc"

}  // namespace

ProjectedLanes project_block_sse41(const ProjectJob& job) { return project_in_lanes(job); }

}  // namespace figurine::kernels
