// A network's head to world-space Gaussians: the specification of every other kernel.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

#include "runtime/src/kernels/decode_skin.inc"

}  // namespace

void decode_skin_baseline(const DecodeSkinJob& job) { decode_skin(job); }

}  // namespace figurine::kernels
