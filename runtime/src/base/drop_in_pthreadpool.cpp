// pthreadpool's interface on threads that give way (worker_pool.h), to be linked into a program, or
// loaded beside libfigurine.so, in place of the system's library: XNNPACK, whose loops these are,
// then finds these functions first.
//
// The system's pool waits by spinning, for tens of milliseconds: a caller waits for a worker to
// come even if nothing is left to do, and keeps the CPU that the worker is to run on. Where CPUs
// are fewer than threads that want them, a network takes ten times as long
// (docs/decisions/0024-threads.md). All of the interface is here, the deprecated part too, so that
// no call can reach the other library with a pool of this one. Which core a task runs on is not
// looked at: the *_with_uarch functions pass on the default.
#pragma GCC visibility push(default)  // hidden ones would not be found by XNNPACK
#include <pthreadpool.h>
#pragma GCC visibility pop

#include <algorithm>
#include <array>
#include <memory>
#include <new>
#include <utility>

#include "runtime/src/base/drop_in_pthreadpool.h"
#include "runtime/src/base/float_mode.h"
#include "runtime/src/base/worker_pool.h"

struct pthreadpool {
  std::unique_ptr<figurine::WorkerPool> workers;
};

namespace {

using figurine::FloatMode;
using figurine::FloatModeScope;
using figurine::WorkerPool;

// More batches than threads, so that a thread that comes late or is taken away leaves little
// undone.
constexpr size_t kBatchesPerThread = 8;

// A grid of D dimensions, the last K of them in tiles. call(thread, place in every dimension...,
// extent in every tiled one...) once for each item or tile.
template <size_t D, size_t K, class Call>
struct Grid {
  std::array<size_t, D> range;
  std::array<size_t, K> tile;
  bool denormals_off;
  const Call& call;
  std::array<size_t, D> steps;  // items or tiles in every dimension
  size_t count;                 // of all
  size_t batch;                 // that a thread takes at once

  Grid(const std::array<size_t, D>& ranges, const std::array<size_t, K>& tiles, bool flush,
       size_t threads, const Call& called)
      : range(ranges), tile(tiles), denormals_off(flush), call(called), steps(ranges), count(1) {
    for (size_t k = 0; k < K; ++k) {
      const size_t d = D - K + k;
      steps[d] = (range[d] + tile[k] - 1) / tile[k];
    }
    for (const size_t step : steps) count *= step;
    batch = threads == 1 ? count : std::max<size_t>(1, count / (kBatchesPerThread * threads));
  }

  // Items [begin, end) in their order. Only the first one's place takes divisions.
  void visit(size_t begin, size_t end, size_t thread) const {
    std::array<size_t, D> step{};
    size_t rest = begin;
    for (size_t d = D; d-- > 0; rest /= steps[d]) step[d] = rest % steps[d];
    for (size_t item = begin; item < end; ++item) {
      visit(step, thread);
      for (size_t d = D; d-- > 0 && ++step[d] == steps[d];) step[d] = 0;
    }
  }
  void visit(const std::array<size_t, D>& step, size_t thread) const {
    std::array<size_t, D> place = step;
    std::array<size_t, K> extent;
    for (size_t k = 0; k < K; ++k) {
      const size_t d = D - K + k;
      place[d] *= tile[k];
      extent[k] = std::min(range[d] - place[d], tile[k]);
    }
    [&]<size_t... P, size_t... E>(std::index_sequence<P...>, std::index_sequence<E...>) {
      call(thread, place[P]..., extent[E]...);
    }(std::make_index_sequence<D>(), std::make_index_sequence<K>());
  }
  static void share(void* context, WorkerPool::Loop& loop, uint32_t thread) {
    const Grid& grid = *static_cast<const Grid*>(context);
    // Workers have their caller's mode already.
    const FloatMode mode = FloatMode::of_this_thread();
    const FloatModeScope in_mode(grid.denormals_off ? mode.without_denormals() : mode);
    for (size_t begin, end; loop.next(grid.batch, begin, end);) grid.visit(begin, end, thread);
  }
};

thread_local uint64_t loops_alone = 0;

template <size_t D, size_t K, class Call>
void loop(pthreadpool* pool, const std::array<size_t, D>& range, const std::array<size_t, K>& tile,
          uint32_t flags, const Call& call) {
  Grid<D, K, Call> grid(range, tile, (flags & PTHREADPOOL_FLAG_DISABLE_DENORMALS) != 0,
                        pool != nullptr ? pool->workers->threads() : 1, call);
  if (pool != nullptr) {
    pool->workers->run(grid.count, grid.share, &grid);
  } else {
    ++loops_alone;
    WorkerPool::run_alone(grid.count, grid.share, &grid);
  }
}

constexpr std::array<size_t, 0> kNoTiles{};

template <class Function>
auto plain(Function* function, void* context) {
  return [=](size_t, auto... at) { function(context, at...); };
}
template <class Function>
auto with_thread(Function* function, void* context) {
  return [=](size_t thread, auto... at) { function(context, thread, at...); };
}
template <class Function>
auto with_uarch(Function* function, void* context, uint32_t uarch) {
  return [=](size_t, auto... at) { function(context, uarch, at...); };
}
template <class Function>
auto with_uarch_with_thread(Function* function, void* context, uint32_t uarch) {
  return [=](size_t thread, auto... at) { function(context, uarch, thread, at...); };
}

pthreadpool* create(size_t threads_count) {
  if (threads_count == 0) threads_count = figurine::allowed_cpus();
  std::unique_ptr<pthreadpool> pool(new (std::nothrow) pthreadpool);
  if (pool == nullptr) return nullptr;
  pool->workers = WorkerPool::create(
      static_cast<uint32_t>(std::min<size_t>(threads_count, WorkerPool::kMaxThreads)));
  return pool->workers != nullptr ? pool.release() : nullptr;
}

void destroy(pthreadpool* pool) { delete pool; }

constexpr figurine::DropInPthreadpool kDropIn = {
    .create = create, .destroy = destroy, .loops_alone = [] { return loops_alone; }};

}  // namespace

extern "C" {

const figurine::DropInPthreadpool* figurine_drop_in_pthreadpool() { return &kDropIn; }

pthreadpool_t pthreadpool_create(size_t threads_count) { return create(threads_count); }

void pthreadpool_destroy(pthreadpool_t pool) { destroy(pool); }

size_t pthreadpool_get_threads_count(pthreadpool_t pool) {
  return pool == nullptr ? 1 : pool->workers->threads();
}

void pthreadpool_parallelize_1d(pthreadpool_t pool, pthreadpool_task_1d_t function, void* context,
                                size_t range_i, uint32_t flags) {
  loop(pool, std::array{range_i}, kNoTiles, flags, plain(function, context));
}

void pthreadpool_parallelize_1d_with_thread(pthreadpool_t pool,
                                            pthreadpool_task_1d_with_thread_t function,
                                            void* context, size_t range_i, uint32_t flags) {
  loop(pool, std::array{range_i}, kNoTiles, flags, with_thread(function, context));
}

void pthreadpool_parallelize_1d_with_uarch(pthreadpool_t pool,
                                           pthreadpool_task_1d_with_id_t function, void* context,
                                           uint32_t uarch, uint32_t, size_t range_i,
                                           uint32_t flags) {
  loop(pool, std::array{range_i}, kNoTiles, flags, with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_1d_tile_1d(pthreadpool_t pool, pthreadpool_task_1d_tile_1d_t function,
                                        void* context, size_t range_i, size_t tile_i,
                                        uint32_t flags) {
  loop(pool, std::array{range_i}, std::array{tile_i}, flags, plain(function, context));
}

void pthreadpool_parallelize_2d(pthreadpool_t pool, pthreadpool_task_2d_t function, void* context,
                                size_t range_i, size_t range_j, uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, kNoTiles, flags, plain(function, context));
}

void pthreadpool_parallelize_2d_with_thread(pthreadpool_t pool,
                                            pthreadpool_task_2d_with_thread_t function,
                                            void* context, size_t range_i, size_t range_j,
                                            uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, kNoTiles, flags, with_thread(function, context));
}

void pthreadpool_parallelize_2d_tile_1d(pthreadpool_t pool, pthreadpool_task_2d_tile_1d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t tile_j, uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_j}, flags, plain(function, context));
}

void pthreadpool_parallelize_2d_tile_1d_with_uarch(pthreadpool_t pool,
                                                   pthreadpool_task_2d_tile_1d_with_id_t function,
                                                   void* context, uint32_t uarch, uint32_t,
                                                   size_t range_i, size_t range_j, size_t tile_j,
                                                   uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_j}, flags,
       with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_2d_tile_1d_with_uarch_with_thread(
    pthreadpool_t pool, pthreadpool_task_2d_tile_1d_with_id_with_thread_t function, void* context,
    uint32_t uarch, uint32_t, size_t range_i, size_t range_j, size_t tile_j, uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_j}, flags,
       with_uarch_with_thread(function, context, uarch));
}

void pthreadpool_parallelize_2d_tile_2d(pthreadpool_t pool, pthreadpool_task_2d_tile_2d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t tile_i, size_t tile_j, uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_i, tile_j}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_2d_tile_2d_with_uarch(pthreadpool_t pool,
                                                   pthreadpool_task_2d_tile_2d_with_id_t function,
                                                   void* context, uint32_t uarch, uint32_t,
                                                   size_t range_i, size_t range_j, size_t tile_i,
                                                   size_t tile_j, uint32_t flags) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_i, tile_j}, flags,
       with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_3d(pthreadpool_t pool, pthreadpool_task_3d_t function, void* context,
                                size_t range_i, size_t range_j, size_t range_k, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, kNoTiles, flags, plain(function, context));
}

void pthreadpool_parallelize_3d_tile_1d(pthreadpool_t pool, pthreadpool_task_3d_tile_1d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t tile_k, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_k}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_3d_tile_1d_with_thread(
    pthreadpool_t pool, pthreadpool_task_3d_tile_1d_with_thread_t function, void* context,
    size_t range_i, size_t range_j, size_t range_k, size_t tile_k, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_k}, flags,
       with_thread(function, context));
}

void pthreadpool_parallelize_3d_tile_1d_with_uarch(pthreadpool_t pool,
                                                   pthreadpool_task_3d_tile_1d_with_id_t function,
                                                   void* context, uint32_t uarch, uint32_t,
                                                   size_t range_i, size_t range_j, size_t range_k,
                                                   size_t tile_k, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_k}, flags,
       with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_3d_tile_1d_with_uarch_with_thread(
    pthreadpool_t pool, pthreadpool_task_3d_tile_1d_with_id_with_thread_t function, void* context,
    uint32_t uarch, uint32_t, size_t range_i, size_t range_j, size_t range_k, size_t tile_k,
    uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_k}, flags,
       with_uarch_with_thread(function, context, uarch));
}

void pthreadpool_parallelize_3d_tile_2d(pthreadpool_t pool, pthreadpool_task_3d_tile_2d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t tile_j, size_t tile_k,
                                        uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_j, tile_k}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_3d_tile_2d_with_uarch(pthreadpool_t pool,
                                                   pthreadpool_task_3d_tile_2d_with_id_t function,
                                                   void* context, uint32_t uarch, uint32_t,
                                                   size_t range_i, size_t range_j, size_t range_k,
                                                   size_t tile_j, size_t tile_k, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_j, tile_k}, flags,
       with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_4d(pthreadpool_t pool, pthreadpool_task_4d_t function, void* context,
                                size_t range_i, size_t range_j, size_t range_k, size_t range_l,
                                uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l}, kNoTiles, flags,
       plain(function, context));
}

void pthreadpool_parallelize_4d_tile_1d(pthreadpool_t pool, pthreadpool_task_4d_tile_1d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t tile_l,
                                        uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l}, std::array{tile_l}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_4d_tile_2d(pthreadpool_t pool, pthreadpool_task_4d_tile_2d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t tile_k,
                                        size_t tile_l, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l}, std::array{tile_k, tile_l}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_4d_tile_2d_with_uarch(pthreadpool_t pool,
                                                   pthreadpool_task_4d_tile_2d_with_id_t function,
                                                   void* context, uint32_t uarch, uint32_t,
                                                   size_t range_i, size_t range_j, size_t range_k,
                                                   size_t range_l, size_t tile_k, size_t tile_l,
                                                   uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l}, std::array{tile_k, tile_l}, flags,
       with_uarch(function, context, uarch));
}

void pthreadpool_parallelize_5d(pthreadpool_t pool, pthreadpool_task_5d_t function, void* context,
                                size_t range_i, size_t range_j, size_t range_k, size_t range_l,
                                size_t range_m, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m}, kNoTiles, flags,
       plain(function, context));
}

void pthreadpool_parallelize_5d_tile_1d(pthreadpool_t pool, pthreadpool_task_5d_tile_1d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t range_m,
                                        size_t tile_m, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m}, std::array{tile_m}, flags,
       plain(function, context));
}

void pthreadpool_parallelize_5d_tile_2d(pthreadpool_t pool, pthreadpool_task_5d_tile_2d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t range_m,
                                        size_t tile_l, size_t tile_m, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m}, std::array{tile_l, tile_m},
       flags, plain(function, context));
}

void pthreadpool_parallelize_6d(pthreadpool_t pool, pthreadpool_task_6d_t function, void* context,
                                size_t range_i, size_t range_j, size_t range_k, size_t range_l,
                                size_t range_m, size_t range_n, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m, range_n}, kNoTiles, flags,
       plain(function, context));
}

void pthreadpool_parallelize_6d_tile_1d(pthreadpool_t pool, pthreadpool_task_6d_tile_1d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t range_m,
                                        size_t range_n, size_t tile_n, uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m, range_n}, std::array{tile_n},
       flags, plain(function, context));
}

void pthreadpool_parallelize_6d_tile_2d(pthreadpool_t pool, pthreadpool_task_6d_tile_2d_t function,
                                        void* context, size_t range_i, size_t range_j,
                                        size_t range_k, size_t range_l, size_t range_m,
                                        size_t range_n, size_t tile_m, size_t tile_n,
                                        uint32_t flags) {
  loop(pool, std::array{range_i, range_j, range_k, range_l, range_m, range_n},
       std::array{tile_m, tile_n}, flags, plain(function, context));
}

// Deprecated, for NNPACK.

void pthreadpool_compute_1d(pthreadpool_t pool, pthreadpool_function_1d_t function, void* context,
                            size_t range_i) {
  loop(pool, std::array{range_i}, kNoTiles, 0, plain(function, context));
}

void pthreadpool_compute_1d_tiled(pthreadpool_t pool, pthreadpool_function_1d_tiled_t function,
                                  void* context, size_t range_i, size_t tile_i) {
  loop(pool, std::array{range_i}, std::array{tile_i}, 0, plain(function, context));
}

void pthreadpool_compute_2d(pthreadpool_t pool, pthreadpool_function_2d_t function, void* context,
                            size_t range_i, size_t range_j) {
  loop(pool, std::array{range_i, range_j}, kNoTiles, 0, plain(function, context));
}

void pthreadpool_compute_2d_tiled(pthreadpool_t pool, pthreadpool_function_2d_tiled_t function,
                                  void* context, size_t range_i, size_t range_j, size_t tile_i,
                                  size_t tile_j) {
  loop(pool, std::array{range_i, range_j}, std::array{tile_i, tile_j}, 0, plain(function, context));
}

void pthreadpool_compute_3d_tiled(pthreadpool_t pool, pthreadpool_function_3d_tiled_t function,
                                  void* context, size_t range_i, size_t range_j, size_t range_k,
                                  size_t tile_i, size_t tile_j, size_t tile_k) {
  loop(pool, std::array{range_i, range_j, range_k}, std::array{tile_i, tile_j, tile_k}, 0,
       plain(function, context));
}

void pthreadpool_compute_4d_tiled(pthreadpool_t pool, pthreadpool_function_4d_tiled_t function,
                                  void* context, size_t range_i, size_t range_j, size_t range_k,
                                  size_t range_l, size_t tile_i, size_t tile_j, size_t tile_k,
                                  size_t tile_l) {
  loop(pool, std::array{range_i, range_j, range_k, range_l},
       std::array{tile_i, tile_j, tile_k, tile_l}, 0, plain(function, context));
}

}  // extern "C"
