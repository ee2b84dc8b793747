// Many independent jobs in processes of their own, a fixed number at a time: a job that crashes, is
// killed or runs out of disk takes no other with it, and two one-thread trainings on two cores do
// more than one two-thread training after the other.
//
// A job runs in a forked copy of the caller, so the caller must not have started threads
// (LibTorch's included) before. Jobs end when their parent does: they get SIGINT, save, and stop.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace figurine::train {

struct JobResult {
  bool done = false;         // the job returned
  bool interrupted = false;  // by Interrupted
  std::string text;          // what the job returned, or one line saying why it failed
};

struct SlotOptions {
  unsigned slots = 1;
  double poll_period_s = 0.1;
};

// Runs job(i) for i in [0, count). InputError and any other exception of a job become its text; so
// does the signal that killed it. ended(i, result) is called in the parent when a job has ended, in
// order of ending; waiting() about every poll_period_s between. After SIGINT or SIGTERM the parent
// starts nothing more, passes the signal on, waits for what runs, and throws Interrupted.
void run_in_slots(size_t count, const SlotOptions& options,
                  const std::function<std::string(size_t)>& job,
                  const std::function<void(size_t, const JobResult&)>& ended,
                  const std::function<void()>& waiting);

}  // namespace figurine::train
