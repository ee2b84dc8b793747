#include "toolchain/model/parallel.h"

#include <omp.h>

#include <algorithm>

namespace figurine::model {

void parallel_tasks(uint32_t threads, uint32_t tasks, void (*run)(void* context, uint32_t task),
                    void* context) {
  const uint32_t used = std::min(threads, tasks);
  if (used <= 1 || omp_in_parallel()) {
    for (uint32_t task = 0; task < tasks; ++task) run(context, task);
    return;
  }
#pragma omp parallel for schedule(dynamic, 1) num_threads(static_cast<int>(used))
  for (uint32_t task = 0; task < tasks; ++task) run(context, task);
}

}  // namespace figurine::model
