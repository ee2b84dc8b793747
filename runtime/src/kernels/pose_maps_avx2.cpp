// pose_maps.inc in vectors of eight lanes.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/pose_maps.inc"

}  // namespace

void pose_maps_avx2(const PoseMapsJob& job) { pose_maps(job); }

}  // namespace figurine::kernels
