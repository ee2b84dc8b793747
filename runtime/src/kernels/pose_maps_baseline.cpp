// What a network sees of a block of texels: the specification of every other kernel.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/pose_maps.inc"

}  // namespace

void pose_maps_baseline(const PoseMapsJob& job) { pose_maps(job); }

}  // namespace figurine::kernels
