// blend_transforms.inc in NEON.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

#include "runtime/src/kernels/blend_transforms.inc"

}  // namespace

void blend_transforms_neon(const BlendTransformsJob& job) { blend_transforms(job); }

}  // namespace figurine::kernels
