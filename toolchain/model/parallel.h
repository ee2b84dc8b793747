// Work spread over the threads that LibTorch itself uses (OpenMP), so that the trainer has one set
// of threads and no two pools fight for two cores.
//
// Tasks are handed out one by one (whoever is free takes the next), so uneven tasks balance. A task
// must not depend on which thread runs it: everything in this folder writes per-task results and
// reduces them in task order, so that results do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <type_traits>

namespace figurine::model {

// Calls run(context, task) for every task in [0, tasks) on at most `threads` threads, the caller's
// included; returns when all are done.
void parallel_tasks(uint32_t threads, uint32_t tasks, void (*run)(void* context, uint32_t task),
                    void* context);

template <class Body>
void parallel_for(uint32_t threads, uint32_t tasks, Body&& body) {
  using Plain = std::remove_reference_t<Body>;
  parallel_tasks(
      threads, tasks, [](void* context, uint32_t task) { (*static_cast<Plain*>(context))(task); },
      const_cast<void*>(static_cast<const void*>(&body)));
}

}  // namespace figurine::model
