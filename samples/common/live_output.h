// Where live frames go, by its name: "-" (y4m on standard output), "window", a video device, a
// FIFO or another thing that bytes can be written to, a file x.y4m, which appears whole when the
// run ends or not at all.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "ports/host/atomic_file.h"
#include "samples/common/live_sink.h"
#include "samples/common/parse.h"

namespace figurine::samples {

class LiveOutput {
 public:
  struct Options {
    ImageSize size;
    double frames_per_second = 30;
  };
  // Waits for the reader of a FIFO, with a line on standard error. kUnsupported for names that mean
  // nothing here and for a terminal; kIo as the system says; kInterrupted.
  static Result<LiveOutput> open(const std::string& name, const Options& options);
  // The same without opening anything: whether the name can mean something.
  static Status check(const std::string& name);

  LiveOutput(LiveOutput&& other) noexcept;
  LiveOutput& operator=(LiveOutput&&) = delete;
  ~LiveOutput();

  LiveSink& sink() { return *sink_; }
  // Gives the receiver what it began to take, or a file its name. Call once, at the end.
  Status finish();

 private:
  LiveOutput() = default;

  std::optional<ports::AtomicFile> file_;
  int descriptor_ = -1;  // own, to close
  std::unique_ptr<LiveSink> sink_;
};

}  // namespace figurine::samples
