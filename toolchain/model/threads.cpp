#include "toolchain/model/threads.h"

#include <dlfcn.h>

#include <algorithm>

#include "ports/host/cpus.h"

#include "toolchain/tensor_operations.h"

namespace figurine::model {

void use_threads(uint32_t count) {
  at::set_num_threads(static_cast<int>(count));
  // Whichever BLAS Debian's alternatives chose: only OpenBLAS has threads of its own.
  if (void* function = dlsym(RTLD_DEFAULT, "openblas_set_num_threads")) {
    reinterpret_cast<void (*)(int)>(function)(static_cast<int>(count));
  }
}

uint32_t default_threads() { return std::min(ports::usable_cpus(), 16u); }

}  // namespace figurine::model
