// The splatter's kernels for the baseline instruction set; also in double, for the finite-difference checks.
#include "toolchain/model/splat_kernels.h"

#define FIG_KERNEL_NAMESPACE generic
#define FIG_KERNEL_DOUBLE
#include "toolchain/model/splat_kernels.inc"
