// The kernels of splatter and SSIM for AVX2 with FMA (x86-64-v3).
#include <immintrin.h>

#include "toolchain/model/splat_kernels.h"
#include "toolchain/model/ssim_kernels.h"

#define FIG_KERNEL_NAMESPACE avx2
#include "toolchain/model/splat_kernels.inc"
#include "toolchain/model/ssim_kernels.inc"
