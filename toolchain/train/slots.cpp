#include "toolchain/train/slots.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <map>
#include <thread>

#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"

namespace figurine::train {

namespace {

enum ExitCode { kDone = 0, kFailed = 1, kInterrupted = 130 };

struct RunningJob {
  size_t index = 0;
  int pipe = -1;  // the job's text
  std::string text;
};

void write_all(int file, const std::string& text) {
  size_t written = 0;
  while (written < text.size()) {
    const ssize_t n = write(file, text.data() + written, text.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;  // the parent is gone: nobody is left to tell
    written += static_cast<size_t>(n);
  }
}

[[noreturn]] void run_child(size_t index, const std::function<std::string(size_t)>& job, int pipe,
                            pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGINT);
  if (getppid() != parent) _exit(kInterrupted);  // it died before it could tell
  int code = kFailed;
  try {
    write_all(pipe, job(index));
    code = kDone;
  } catch (const Interrupted& interrupted) {
    write_all(pipe, interrupted.what());
    code = kInterrupted;
  } catch (const std::exception& error) {
    write_all(pipe, error.what());
  }
  std::fflush(nullptr);
  _exit(code);  // not exit: static objects are the parent's
}

RunningJob start(size_t index, const std::function<std::string(size_t)>& job, pid_t& pid) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw InputError(std::string("cannot start a job: ") + std::strerror(errno));
  std::fflush(nullptr);  // what is buffered would be printed by both
  const pid_t parent = getpid();
  pid = fork();
  if (pid < 0) {
    const int reason = errno;
    close(ends[0]), close(ends[1]);
    throw InputError(std::string("cannot start a job: ") + std::strerror(reason));
  }
  if (pid == 0) {
    close(ends[0]);
    run_child(index, job, ends[1], parent);
  }
  close(ends[1]);
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return {.index = index, .pipe = ends[0], .text = {}};
}

// Reads what is there, so that a long text cannot block the job.
void drain(RunningJob& job) {
  char buffer[4096];
  for (ssize_t n; (n = read(job.pipe, buffer, sizeof(buffer))) > 0;)
    job.text.append(buffer, static_cast<size_t>(n));
}

JobResult result_of(RunningJob& job, int status) {
  drain(job);
  close(job.pipe);
  JobResult result{.done = false, .interrupted = false, .text = std::move(job.text)};
  if (WIFSIGNALED(status)) {
    result.text = std::string("ended by signal ") + std::to_string(WTERMSIG(status)) + " (" +
                  strsignal(WTERMSIG(status)) + ")";
  } else {
    result.done = WEXITSTATUS(status) == kDone;
    result.interrupted = WEXITSTATUS(status) == kInterrupted;
  }
  return result;
}

}  // namespace

void run_in_slots(size_t count, const SlotOptions& options,
                  const std::function<std::string(size_t)>& job,
                  const std::function<void(size_t, const JobResult&)>& ended,
                  const std::function<void()>& waiting) {
  std::map<pid_t, RunningJob> running;
  size_t next = 0;
  bool passed_on = false;
  const InterruptGuard interrupt;
  while (next < count || !running.empty()) {
    if (interrupt.requested() && !passed_on) {
      passed_on = true;
      next = count;
      for (const auto& [pid, job_of_pid] : running) kill(pid, SIGTERM);
    }
    while (next < count && running.size() < options.slots) {
      pid_t pid = 0;
      RunningJob started = start(next, job, pid);
      running.emplace(pid, std::move(started));
      ++next;
    }
    for (auto at = running.begin(); at != running.end();) {
      drain(at->second);
      int status = 0;
      if (waitpid(at->first, &status, WNOHANG) != at->first) {
        ++at;
        continue;
      }
      const size_t index = at->second.index;
      const JobResult result = result_of(at->second, status);
      at = running.erase(at);
      ended(index, result);
    }
    waiting();
    if (!running.empty())
      std::this_thread::sleep_for(std::chrono::duration<double>(options.poll_period_s));
  }
  if (passed_on) throw Interrupted("stopped; --resume goes on from here");
}

}  // namespace figurine::train
