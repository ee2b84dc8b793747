// Dot products of int16 arrays to exact int32 sums, four rows at a time: enough to hide the loads,
// few enough for 16 registers. Compilers make pmaddwd (SSE2) or smlal (NEON) of the loop. Two rows
// of `shared` at once were no faster.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

void add_four(const int16_t* __restrict shared, const int16_t* __restrict rows, uint64_t length,
              int32_t* __restrict sums) {
  shared = static_cast<const int16_t*>(__builtin_assume_aligned(shared, 16));
  rows = static_cast<const int16_t*>(__builtin_assume_aligned(rows, 16));
  length = length / kDotMultiple * kDotMultiple;  // changes nothing, but compilers see it
  const int16_t *r0 = rows, *r1 = r0 + length, *r2 = r1 + length, *r3 = r2 + length;
  int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  for (uint64_t k = 0; k < length; ++k) {
    s0 += int32_t{shared[k]} * r0[k];
    s1 += int32_t{shared[k]} * r1[k];
    s2 += int32_t{shared[k]} * r2[k];
    s3 += int32_t{shared[k]} * r3[k];
  }
  sums[0] += s0;
  sums[1] += s1;
  sums[2] += s2;
  sums[3] += s3;
}

}  // namespace

void add_dots_baseline(const AddDotsJob& job) {
  for (uint64_t i = 0; i < job.count; i += kDotsAtOnce) {
    add_four(job.shared, job.rows + i * job.length, job.length, job.sums + i);
  }
}

}  // namespace figurine::kernels
