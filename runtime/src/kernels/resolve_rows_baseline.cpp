// A blended tile's pixels to bytes or floats: the specification of every other kernel.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/resolve_rows.inc"

}  // namespace

void resolve_rows_baseline(const ResolveRowsJob& job) { resolve_rows(job); }

}  // namespace figurine::kernels
