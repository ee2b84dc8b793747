// Waiting for a time: not before it, not at all for one that is past, and through signals.
#include "ports/host/clock.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/time.h>

namespace figurine::ports::clock_test {
namespace {

TEST(SleepUntil, ReturnsNoEarlierThanAsked) {
  for (const uint64_t wait_ns : {0ull, 1ull, 100'000ull, 5'000'000ull}) {
    const uint64_t until_ns = now_ns() + wait_ns;
    sleep_until(until_ns);
    EXPECT_GE(now_ns(), until_ns);
  }
}

TEST(SleepUntil, DoesNotWaitForThePast) {
  const uint64_t start_ns = now_ns();
  for (int i = 0; i < 100; ++i) sleep_until(start_ns - 1'000'000);
  sleep_until(0);
  EXPECT_LT(now_ns() - start_ns, 1'000'000'000u);
}

TEST(SleepUntil, GoesOnAfterASignal) {
  static volatile sig_atomic_t signals = 0;
  struct sigaction action{}, before{};
  action.sa_handler = [](int) { signals = signals + 1; };
  ASSERT_EQ(::sigaction(SIGALRM, &action, &before), 0);
  const itimerval every_ms{.it_interval = {0, 1000}, .it_value = {0, 1000}}, never{};
  const uint64_t until_ns = now_ns() + 30'000'000;
  ::setitimer(ITIMER_REAL, &every_ms, nullptr);
  sleep_until(until_ns);
  const uint64_t woke_ns = now_ns();
  ::setitimer(ITIMER_REAL, &never, nullptr);
  ::sigaction(SIGALRM, &before, nullptr);
  EXPECT_GE(woke_ns, until_ns);
  EXPECT_GT(signals, 0);
}

}  // namespace
}  // namespace figurine::ports::clock_test
