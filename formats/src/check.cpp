// Where a broken contract ends: one line to the handler or to stderr, then abort. Allocates
// nothing, because a broken contract may well be a broken heap.
#include "figurine/check.h"

#include <atomic>
#include <cstdio>
#include <cstdlib>

namespace figurine {
namespace {

std::atomic<CheckHandler> check_handler{nullptr};
std::atomic<void*> check_user{nullptr};

}  // namespace

void set_check_handler(CheckHandler handler, void* user) {
  check_handler.store(nullptr, std::memory_order_release);  // never the one with the other's user
  check_user.store(user, std::memory_order_release);
  check_handler.store(handler, std::memory_order_release);
}

void check_failed(const char* file, int line, const char* message, const char* condition) {
  char text[512];
  std::snprintf(text, sizeof text, "%s:%d: contract broken: %s (%s)", file, line, message,
                condition);
  if (const CheckHandler handler = check_handler.load(std::memory_order_acquire)) {
    handler(text, check_user.load(std::memory_order_acquire));
  } else {
    std::fprintf(stderr, "%s\n", text);
  }
  std::abort();
}

}  // namespace figurine
