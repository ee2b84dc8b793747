// Projection in lanes, four Gaussians at once.
#include <arm_neon.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/lanes_neon.inc"

#include "runtime/src/kernels/projection_constants.inc"

#include "runtime/src/kernels/project_lanes.inc"

}  // namespace

ProjectedLanes project_block_neon(const ProjectJob& job) { return project_in_lanes(job); }

}  // namespace figurine::kernels
