// The kernels of splatter and SSIM for the baseline instruction set; also in double, for the
// finite-difference checks.
#include "toolchain/model/splat_kernels.h"
#include "toolchain/model/ssim_kernels.h"

#define FIG_KERNEL_NAMESPACE generic
#define FIG_KERNEL_DOUBLE
#include "toolchain/model/splat_kernels.inc"
#include "toolchain/model/ssim_kernels.inc"
