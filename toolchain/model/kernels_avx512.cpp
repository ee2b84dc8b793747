// The kernels of splatter and SSIM for AVX-512 (x86-64-v4).
#include <immintrin.h>

#include "toolchain/model/splat_kernels.h"
#include "toolchain/model/ssim_kernels.h"

#define FIG_KERNEL_NAMESPACE avx512
#include "toolchain/model/splat_kernels.inc"
#include "toolchain/model/ssim_kernels.inc"
