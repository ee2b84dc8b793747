// The thread pool by itself: every task once, loops within loops, thousands of loops with sleeps
// between them, many pools, more threads than tasks or CPUs, and a system that gives no threads.
// With the system's pthreadpool, which waits for ever for a thread that it could not start.
#include "runtime/src/base/thread_pool.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <set>
#include <vector>

#include "figurine/renderer.h"

namespace figurine {
namespace {

ThreadPool make_pool(uint32_t threads) {
  Result<ThreadPool> pool = ThreadPool::create(threads);
  EXPECT_TRUE(pool.ok()) << pool.status().message();
  EXPECT_EQ(pool->threads(), threads);
  return std::move(pool).value();
}

void sleep_ms(long ms) {
  const timespec time{.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
  ::nanosleep(&time, nullptr);
}

TEST(ThreadPool, VisitsEveryIndexOnce) {
  for (const uint32_t threads : {1u, 2u, 5u, 64u}) {
    ThreadPool pool = make_pool(threads);
    for (const size_t count : {size_t{0}, size_t{1}, size_t{2}, size_t{3}, size_t{1000}}) {
      std::vector<int> visits(count, 0);
      pool.for_each(count, [&](size_t i) { ++visits[i]; });
      EXPECT_EQ(visits, std::vector<int>(count, 1)) << threads << " threads";
    }
  }
}

TEST(ThreadPool, SeesWhatWasWrittenBeforeAndShowsWhatItWrote) {
  ThreadPool pool = make_pool(3);
  std::vector<uint64_t> values(64, 1);
  for (int loop = 0; loop < 50; ++loop) {
    for (uint64_t& value : values) value += 1;
    pool.for_each(values.size(), [&](size_t i) { values[i] *= 3; });
  }
  uint64_t expected = 1;
  for (int loop = 0; loop < 50; ++loop) expected = (expected + 1) * 3;
  EXPECT_EQ(values, std::vector<uint64_t>(64, expected));
}

TEST(ThreadPool, OtherThreadsTakePart) {
  ThreadPool pool = make_pool(2);
  // A task that waits for the other: two threads must be in the loop at once.
  std::atomic<int> arrived{0};
  pool.for_each(2, [&](size_t) {
    ++arrived;
    while (arrived.load() < 2) ::sched_yield();
  });
  EXPECT_EQ(arrived.load(), 2);
}

TEST(ThreadPool, ALoopWithinALoopRunsOnItsOwnThread) {
  for (const uint32_t threads : {1u, 4u}) {
    ThreadPool pool = make_pool(threads);
    std::vector<int> visits(20 * 30, 0);
    std::atomic<int> strangers{0};
    pool.for_each(20, [&](size_t i) {
      const pthread_t self = ::pthread_self();
      pool.for_each(30, [&](size_t j) {
        ++visits[i * 30 + j];
        if (!::pthread_equal(self, ::pthread_self())) ++strangers;
      });
    });
    EXPECT_EQ(visits, std::vector<int>(20 * 30, 1));
    EXPECT_EQ(strangers.load(), 0);
  }
}

TEST(ThreadPool, CallersOnTwoThreadsShareIt) {
  ThreadPool pool = make_pool(3);
  struct Caller {
    ThreadPool& pool;
    std::vector<int> visits = std::vector<int>(500, 0);
  } callers[] = {{pool}, {pool}};
  const auto call = [](void* argument) -> void* {
    Caller& self = *static_cast<Caller*>(argument);
    for (int loop = 0; loop < 100; ++loop)
      self.pool.for_each(self.visits.size(), [&](size_t i) { ++self.visits[i]; });
    return nullptr;
  };
  pthread_t other;
  ASSERT_EQ(::pthread_create(&other, nullptr, call, &callers[1]), 0);
  call(&callers[0]);
  ::pthread_join(other, nullptr);
  for (const Caller& caller : callers) EXPECT_EQ(caller.visits, std::vector<int>(500, 100));
}

TEST(ThreadPool, SleepsAndWakesThousandsOfTimes) {
  ThreadPool pool = make_pool(4);
  std::atomic<uint64_t> sum{0};
  for (int loop = 0; loop < 5000; ++loop) {
    pool.for_each(7, [&](size_t i) { sum += i; });
    if (loop % 500 == 0) sleep_ms(2);  // everyone sleeps
  }
  EXPECT_EQ(sum.load(), 5000u * 21);
}

TEST(ThreadPool, ManyPoolsComeAndGo) {
  for (int i = 0; i < 100; ++i) {
    ThreadPool pool = make_pool(1 + static_cast<uint32_t>(i) % 5);
    std::atomic<int> visits{0};
    if (i % 3 != 0) pool.for_each(9, [&](size_t) { ++visits; });
    EXPECT_EQ(visits.load(), i % 3 != 0 ? 9 : 0);
  }
  std::vector<ThreadPool> pools;
  for (int i = 0; i < 10; ++i) pools.push_back(make_pool(3));
  std::atomic<int> visits{0};
  for (ThreadPool& pool : pools) pool.for_each(9, [&](size_t) { ++visits; });
  EXPECT_EQ(visits.load(), 90);
}

TEST(ThreadPool, WorkersTakeNoSignals) {
  static std::atomic<int> handled;
  static pthread_t main_thread;
  main_thread = ::pthread_self();
  handled = 0;
  struct sigaction action{}, before{};
  action.sa_handler = [](int) {
    handled += ::pthread_equal(main_thread, ::pthread_self()) ? 1 : 100;
  };
  ASSERT_EQ(::sigaction(SIGUSR1, &action, &before), 0);
  ThreadPool pool = make_pool(4);
  for (int i = 0; i < 20; ++i) {
    ::kill(::getpid(), SIGUSR1);
    pool.for_each(50, [](size_t) {});
  }
  ::sigaction(SIGUSR1, &before, nullptr);
  EXPECT_GT(handled.load(), 0);
  EXPECT_LE(handled.load(), 20);
}

TEST(ThreadPool, RefusesNoneAndTooMany) {
  EXPECT_EQ(ThreadPool::create(0).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(ThreadPool::create(65).status().code(), StatusCode::kInvalidArgument);
}

TEST(ThreadPool, AllowedCpusFollowTheAffinityMask) {
  cpu_set_t all;
  ASSERT_EQ(::sched_getaffinity(0, sizeof(all), &all), 0);
  EXPECT_EQ(allowed_cpus(), static_cast<uint32_t>(CPU_COUNT(&all)));
  cpu_set_t one;
  CPU_ZERO(&one);
  for (int cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++cpu) {
    if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
  }
  ASSERT_EQ(::sched_setaffinity(0, sizeof(one), &one), 0);
  EXPECT_EQ(allowed_cpus(), 1u);
  const Result<std::unique_ptr<Renderer>> capped = Renderer::create({.threads = 4}),
                                          forced = Renderer::create(
                                              {.threads = 4, .allow_oversubscription = true});
  ASSERT_EQ(::sched_setaffinity(0, sizeof(all), &all), 0);
  ASSERT_TRUE(capped.ok() && forced.ok());
  EXPECT_EQ((*capped)->threads(), 1u);
  EXPECT_EQ((*forced)->threads(), 4u);
}

// ---- A system that gives no threads

// What a child process says through its exit code: how many threads a pool of `wanted` got after
// `limit`, and whether its loops are whole.
template <class Limit>
int threads_under(const Limit& limit, uint32_t wanted) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(20);  // a pool that hangs dies of it
    limit();
    Result<ThreadPool> pool = ThreadPool::create(wanted);
    if (!pool.ok()) ::_exit(pool.status().code() == StatusCode::kOutOfMemory ? 101 : 102);
    std::atomic<size_t> sum{0};
    for (int loop = 0; loop < 50; ++loop) pool->for_each(10, [&](size_t i) { sum += i; });
    ::_exit(sum == 50 * 45 ? static_cast<int>(pool->threads()) : 103);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// Half of the threads are XNNPACK's: with room for n more, each side gets n / 2.
TEST(ThreadPool, FewerThreadsWhereTheUserMayHaveNoMore) {
  for (const rlim_t room : {0u, 1u, 2u, 3u, 6u, 40u}) {
    const int threads = threads_under(
        [room] {
          // Nobody else is this user, so this process is its only one; root has no limit.
          const uid_t nobody = 0x7ffffff0u - static_cast<uid_t>(::getpid() % 60000);
          if (::getuid() == 0 && ::setresuid(nobody, nobody, nobody) != 0) ::_exit(110);
          const rlimit limit{.rlim_cur = room + 1, .rlim_max = room + 1};
          if (::setrlimit(RLIMIT_NPROC, &limit) != 0) ::_exit(111);
        },
        8);
    const int most = static_cast<int>(1 + std::min<rlim_t>(room / 2, 7));
    EXPECT_LE(threads, most) << room;
#if !defined(__SANITIZE_THREAD__)  // which has a thread of its own
    if (::getuid() == 0) {         // any other user has further processes
      EXPECT_EQ(threads, most) << room;
    }
#endif
    EXPECT_GE(threads, 1) << room;
  }
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadow is out of reach
TEST(ThreadPool, FewerThreadsWhereTheirStacksHaveNoRoom) {
  const int threads = threads_under(
      [] {
        // Threads of 64 MB each, in 300 MB more than now.
        pthread_attr_t attributes;
        ::pthread_attr_init(&attributes);
        ::pthread_attr_setstacksize(&attributes, size_t{64} << 20);
        ::pthread_setattr_default_np(&attributes);
        rlimit limit{};
        FILE* file = std::fopen("/proc/self/statm", "r");
        unsigned long pages = 0;
        if (file == nullptr || std::fscanf(file, "%lu", &pages) != 1) ::_exit(110);
        std::fclose(file);
        limit.rlim_cur = limit.rlim_max = pages * 4096 + (rlim_t{300} << 20);
        if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(111);
      },
      8);
  EXPECT_GE(threads, 2);
  EXPECT_LE(threads, 3);
}
#endif

}  // namespace
}  // namespace figurine
