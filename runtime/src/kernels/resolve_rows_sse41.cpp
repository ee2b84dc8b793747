// resolve_rows.inc in vectors of four pixels.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/resolve_rows.inc"

}  // namespace

void resolve_rows_sse41(const ResolveRowsJob& job) { resolve_rows(job); }

}  // namespace figurine::kernels
