// A broken contract: one line on stderr or to the handler, then the end of the program.
#include "figurine/check.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace figurine::check_test {
namespace {

// Leaves with a code of its own when it was told what it should be.
void leave(const char* message, void* user) {
  const std::string said = message;
  const bool whole = said.find("check_test.cpp:") != std::string::npos &&
                     said.find(": contract broken: a small number (n < 3)") != std::string::npos &&
                     said.find('\n') == std::string::npos;
  std::fprintf(stderr, "%s", static_cast<const char*>(user));
  std::_Exit(whole ? 42 : 43);
}

void break_contract(int n) { FIG_CHECK(n < 3, "a small number"); }

// What may follow on stderr: QEMU says that its guest was aborted.
#define FIG_END "(qemu: [^\n]*\n)?$"

TEST(Check, SaysWhatWasBrokenAndAborts) {
  break_contract(2);
  EXPECT_EXIT(break_contract(3), testing::KilledBySignal(SIGABRT),
              "check_test.cpp:[0-9]+: contract broken: a small number \\(n < 3\\)\n" FIG_END);
}

TEST(Check, TellsTheHandlerInstead) {
  char user[] = "on the device's log";
  EXPECT_EXIT(
      {
        set_check_handler(leave, user);
        break_contract(3);
      },
      testing::ExitedWithCode(42), "^on the device's log$");
}

TEST(Check, AbortsWhereTheHandlerReturns) {
  EXPECT_EXIT(
      {
        set_check_handler([](const char*, void*) {}, nullptr);
        break_contract(3);
      },
      testing::KilledBySignal(SIGABRT), "^" FIG_END);
}

TEST(Check, WithoutHandlerAgainSpeaksToStderr) {
  EXPECT_EXIT(
      {
        set_check_handler(leave, nullptr);
        set_check_handler(nullptr, nullptr);
        break_contract(3);
      },
      testing::KilledBySignal(SIGABRT), "contract broken: a small number");
}

}  // namespace
}  // namespace figurine::check_test
