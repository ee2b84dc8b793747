#include "toolchain/train/threads.h"

#include <ATen/Parallel.h>
#include <dlfcn.h>

namespace figurine::train {

void use_threads(uint32_t count) {
  at::set_num_threads(static_cast<int>(count));
  // Whichever BLAS Debian's alternatives chose: only OpenBLAS has threads of its own.
  if (void* function = dlsym(RTLD_DEFAULT, "openblas_set_num_threads")) {
    reinterpret_cast<void (*)(int)>(function)(static_cast<int>(count));
  }
}

}  // namespace figurine::train
