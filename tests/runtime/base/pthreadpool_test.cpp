// The drop-in pthreadpool: XNNPACK finds it, every function visits what its loop says, and its
// threads give way.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <pthreadpool.h>
#include <time.h>

#include <atomic>
#include <cstdio>
#include <limits>
#include <vector>

#include "runtime/src/base/thread_pool.h"
#include "runtime/src/nn/xnnpack_graph.h"

namespace figurine {
namespace {

constexpr uint32_t kUarch = 7;
constexpr size_t kRange[] = {3, 5, 2, 4, 3, 2}, kTile = 2;

// What the loops of one function have to visit: the first `dimensions` of kRange, the last `tiled`
// of them in tiles of kTile.
struct Seen {
  size_t dimensions, tiled, prefix;  // prefix: arguments before the place
  size_t threads;
  std::vector<std::atomic<int>> visits;
  std::atomic<int> strange{0};

  Seen(size_t d, size_t k, size_t arguments, size_t thread_count)
      : dimensions(d), tiled(k), prefix(arguments), threads(thread_count), visits(count()) {}

  size_t count() const {
    size_t product = 1;
    for (size_t d = 0; d < dimensions; ++d) product *= kRange[d];
    return product;
  }
  // Marks the items of a block, dimension by dimension.
  void mark(const size_t* place, const size_t* extent, size_t d, size_t item) {
    if (d == dimensions) {
      ++visits[item];
      return;
    }
    const bool in_tiles = d >= dimensions - tiled;
    const size_t size = in_tiles ? extent[d - (dimensions - tiled)] : 1;
    if (place[d] + size > kRange[d] || (in_tiles && place[d] % kTile != 0)) {
      ++strange;
      return;
    }
    for (size_t i = 0; i < size; ++i) mark(place, extent, d + 1, item * kRange[d] + place[d] + i);
  }
};

// A task of any type that pthreadpool knows.
template <class... At>
void visit(void* context, At... at) {
  Seen& seen = *static_cast<Seen*>(context);
  const size_t values[] = {at...};
  if (sizeof...(At) != seen.prefix + seen.dimensions + seen.tiled) {
    ++seen.strange;
    return;
  }
  // Before the place: the microarchitecture, the thread, or both in this order.
  if constexpr (std::is_same_v<std::tuple_element_t<0, std::tuple<At...>>, uint32_t>)
    seen.strange += values[0] != kUarch;
  if (seen.prefix > 0) seen.strange += values[seen.prefix - 1] >= std::max<size_t>(seen.threads, 8);
  seen.mark(values + seen.prefix, values + seen.prefix + seen.dimensions, 0, 0);
}

template <class Call>
void expect_once(size_t dimensions, size_t tiled, size_t prefix, const Call& call) {
  for (const size_t threads : {0u, 1u, 2u, 4u}) {  // 0: no pool at all
    pthreadpool* const pool = threads == 0 ? nullptr : pthreadpool_create(threads);
    Seen seen(dimensions, tiled, prefix, threads);
    for (int loop = 0; loop < 3; ++loop) call(pool, &seen);
    for (const std::atomic<int>& visits : seen.visits) EXPECT_EQ(visits.load(), 3);
    EXPECT_EQ(seen.strange.load(), 0);
    if (pool != nullptr) pthreadpool_destroy(pool);
  }
}

constexpr size_t I = kRange[0], J = kRange[1], K = kRange[2], L = kRange[3], M = kRange[4],
                 N = kRange[5], T = kTile;

TEST(Pthreadpool, ItemsInOneDimension) {
  expect_once(1, 0, 0, [](auto* p, void* c) { pthreadpool_parallelize_1d(p, visit, c, I, 0); });
  expect_once(1, 0, 1,
              [](auto* p, void* c) { pthreadpool_parallelize_1d_with_thread(p, visit, c, I, 0); });
  expect_once(1, 0, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_1d_with_uarch(p, visit, c, kUarch, kUarch, I, 0);
  });
  expect_once(1, 1, 0,
              [](auto* p, void* c) { pthreadpool_parallelize_1d_tile_1d(p, visit, c, I, T, 0); });
}

TEST(Pthreadpool, ItemsInTwoDimensions) {
  expect_once(2, 0, 0, [](auto* p, void* c) { pthreadpool_parallelize_2d(p, visit, c, I, J, 0); });
  expect_once(2, 0, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_with_thread(p, visit, c, I, J, 0);
  });
  expect_once(2, 1, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_tile_1d(p, visit, c, I, J, T, 0);
  });
  expect_once(2, 1, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_tile_1d_with_uarch(p, visit, c, kUarch, kUarch, I, J, T, 0);
  });
  expect_once(2, 1, 2, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_tile_1d_with_uarch_with_thread(p, visit, c, kUarch, kUarch, I, J, T,
                                                              0);
  });
  expect_once(2, 2, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_tile_2d(p, visit, c, I, J, T, T, 0);
  });
  expect_once(2, 2, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_2d_tile_2d_with_uarch(p, visit, c, kUarch, kUarch, I, J, T, T, 0);
  });
}

TEST(Pthreadpool, ItemsInThreeDimensions) {
  expect_once(3, 0, 0,
              [](auto* p, void* c) { pthreadpool_parallelize_3d(p, visit, c, I, J, K, 0); });
  expect_once(3, 1, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_1d(p, visit, c, I, J, K, T, 0);
  });
  expect_once(3, 1, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_1d_with_thread(p, visit, c, I, J, K, T, 0);
  });
  expect_once(3, 1, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_1d_with_uarch(p, visit, c, kUarch, kUarch, I, J, K, T, 0);
  });
  expect_once(3, 1, 2, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_1d_with_uarch_with_thread(p, visit, c, kUarch, kUarch, I, J, K,
                                                              T, 0);
  });
  expect_once(3, 2, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_2d(p, visit, c, I, J, K, T, T, 0);
  });
  expect_once(3, 2, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_3d_tile_2d_with_uarch(p, visit, c, kUarch, kUarch, I, J, K, T, T, 0);
  });
}

TEST(Pthreadpool, ItemsInFourAndMoreDimensions) {
  expect_once(4, 0, 0,
              [](auto* p, void* c) { pthreadpool_parallelize_4d(p, visit, c, I, J, K, L, 0); });
  expect_once(4, 1, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_4d_tile_1d(p, visit, c, I, J, K, L, T, 0);
  });
  expect_once(4, 2, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_4d_tile_2d(p, visit, c, I, J, K, L, T, T, 0);
  });
  expect_once(4, 2, 1, [](auto* p, void* c) {
    pthreadpool_parallelize_4d_tile_2d_with_uarch(p, visit, c, kUarch, kUarch, I, J, K, L, T, T, 0);
  });
  expect_once(5, 0, 0,
              [](auto* p, void* c) { pthreadpool_parallelize_5d(p, visit, c, I, J, K, L, M, 0); });
  expect_once(5, 1, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_5d_tile_1d(p, visit, c, I, J, K, L, M, T, 0);
  });
  expect_once(5, 2, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_5d_tile_2d(p, visit, c, I, J, K, L, M, T, T, 0);
  });
  expect_once(6, 0, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_6d(p, visit, c, I, J, K, L, M, N, 0);
  });
  expect_once(6, 1, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_6d_tile_1d(p, visit, c, I, J, K, L, M, N, T, 0);
  });
  expect_once(6, 2, 0, [](auto* p, void* c) {
    pthreadpool_parallelize_6d_tile_2d(p, visit, c, I, J, K, L, M, N, T, T, 0);
  });
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(Pthreadpool, DeprecatedFunctions) {
  expect_once(1, 0, 0, [](auto* p, void* c) { pthreadpool_compute_1d(p, visit, c, I); });
  expect_once(1, 1, 0, [](auto* p, void* c) { pthreadpool_compute_1d_tiled(p, visit, c, I, T); });
  expect_once(2, 0, 0, [](auto* p, void* c) { pthreadpool_compute_2d(p, visit, c, I, J); });
  expect_once(2, 2, 0,
              [](auto* p, void* c) { pthreadpool_compute_2d_tiled(p, visit, c, I, J, T, T); });
  expect_once(3, 3, 0, [](auto* p, void* c) {
    pthreadpool_compute_3d_tiled(p, visit, c, I, J, K, T, T, T);
  });
  expect_once(4, 4, 0, [](auto* p, void* c) {
    pthreadpool_compute_4d_tiled(p, visit, c, I, J, K, L, T, T, T, T);
  });
}
#pragma GCC diagnostic pop

// Every library of the process finds all of them here, those that are loaded later too.
TEST(Pthreadpool, TakesThePlaceOfTheSystems) {
  Dl_info here{}, found{};
  ASSERT_NE(::dladdr(reinterpret_cast<void*>(&expect_once<void (*)(pthreadpool*, void*)>), &here),
            0);
  for (const char* name : {"pthreadpool_create", "pthreadpool_parallelize_2d_tile_2d",
                           "pthreadpool_compute_4d_tiled"}) {
    void* const function = ::dlsym(RTLD_DEFAULT, name);
    ASSERT_NE(function, nullptr) << name;
    ASSERT_NE(::dladdr(function, &found), 0);
    EXPECT_EQ(found.dli_fbase, here.dli_fbase) << name;
  }
}

// Where its loops are another library's it is given none (tests/consumer).
TEST(Pthreadpool, XnnpackIsGivenTheRuntimesPool) {
  ASSERT_TRUE(initialize_xnnpack().ok());
  const Result<ThreadPool> pool = ThreadPool::create(3);
  ASSERT_TRUE(pool.ok());
  ASSERT_NE(pool->network_pool(), nullptr);
  EXPECT_EQ(xnnpack_pool(*pool), pool->network_pool());
}

TEST(Pthreadpool, DenormalsAreOffWhereItIsAskedAndBackAfterwards) {
  struct Product {
    volatile float tiny = std::numeric_limits<float>::min();
    std::atomic<int> kept{0};
  } product;
  const auto multiply = [](void* context, size_t) {
    auto& self = *static_cast<Product*>(context);
    if (self.tiny * 0.5f != 0) ++self.kept;
  };
  pthreadpool* const pool = pthreadpool_create(3);
  pthreadpool_parallelize_1d(pool, multiply, &product, 100, PTHREADPOOL_FLAG_DISABLE_DENORMALS);
  EXPECT_EQ(product.kept.load(), 0);
  pthreadpool_parallelize_1d(pool, multiply, &product, 100, 0);
  EXPECT_EQ(product.kept.load(), 100);
  pthreadpool_destroy(pool);
}

uint64_t cpu_ns() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<uint64_t>(time.tv_sec) * 1000000000 + static_cast<uint64_t>(time.tv_nsec);
}

// Six idle threads that spun would take a second of CPU or more, if they got it.
TEST(Pthreadpool, IdleThreadsTakeNoCpu) {
  Result<ThreadPool> pool = ThreadPool::create(4);
  ASSERT_TRUE(pool.ok());
  pool->for_each(100, [](size_t) {});
  pthreadpool_parallelize_1d(pool->network_pool(), [](void*, size_t) {}, nullptr, 100, 0);
  const uint64_t before = cpu_ns();
  const timespec time{.tv_sec = 0, .tv_nsec = 300000000};
  ::nanosleep(&time, nullptr);
  const double idle_ms = static_cast<double>(cpu_ns() - before) * 1e-6;
  std::printf("idle for 300 ms: %.2f ms of CPU\n", idle_ms);
  EXPECT_LT(idle_ms, 30);
}

}  // namespace
}  // namespace figurine
