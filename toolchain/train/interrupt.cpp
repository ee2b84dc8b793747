#include "toolchain/train/interrupt.h"

#include <csignal>

namespace figurine::train {

namespace {

volatile std::sig_atomic_t interrupt_requested = 0;
struct sigaction previous_int, previous_term, previous_hup;

void handle(int) { interrupt_requested = 1; }

}  // namespace

InterruptGuard::InterruptGuard() {
  interrupt_requested = 0;
  struct sigaction action{};
  action.sa_handler = handle;
  action.sa_flags = SA_RESETHAND;  // the second signal finds the default handler
  sigaction(SIGINT, &action, &previous_int);
  sigaction(SIGTERM, &action, &previous_term);
  sigaction(SIGHUP, nullptr, &previous_hup);
  if (previous_hup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // nohup stays
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &previous_int, nullptr);
  sigaction(SIGHUP, &previous_hup, nullptr);
  struct sigaction ignore{};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGTERM, ignore_late_ ? &ignore : &previous_term, nullptr);
}

bool InterruptGuard::requested() const { return interrupt_requested != 0; }

void InterruptGuard::ignore_late() { ignore_late_ = true; }

}  // namespace figurine::train
