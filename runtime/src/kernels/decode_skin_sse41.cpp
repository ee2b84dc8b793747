// decode_skin.inc in vectors of four lanes.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/kernel_math.inc"

#include "runtime/src/kernels/decode_skin.inc"

}  // namespace

void decode_skin_sse41(const DecodeSkinJob& job) { decode_skin(job); }

}  // namespace figurine::kernels
