// Live video into a pipe, as y4m: what stands behind "-" and behind a FIFO, for ffmpeg, ffplay and
// everything else that reads a stream.
//
// A reader must get every frame that it has begun to read, whole: the rest of such a frame goes out
// before the next one, which is dropped if that takes until its own end. So there is never more
// than one frame between renderer and reader, besides what the system's pipe holds.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ports/media/y4m.h"
#include "samples/common/live_sink.h"

namespace figurine::samples {

class Y4mPipe final : public LiveSink {
 public:
  // descriptor: open for writing, the caller's to close; name: for messages. Changes none of its
  // flags, which the other users of a standard output share. SIGPIPE must be ignored
  // (catch_interrupts). kInvalidArgument for a rate that y4m cannot say.
  static Result<std::unique_ptr<Y4mPipe>> create(int descriptor, const std::string& name,
                                                 ImageSize size, const Options& options);
  PixelFormat format() const override { return PixelFormat::kRgb24; }
  // Waits up to a second for a reader that is in the middle of a frame. kIo if it does not take it.
  Status finish() override;

 private:
  Y4mPipe(int descriptor, std::string name, const Options& options)
      : LiveSink(options), descriptor_(descriptor), name_(std::move(name)) {}
  Result<bool> put(const RenderedFrame& frame, uint64_t deadline_ns) override;
  // Writes of bytes_ what the pipe takes until deadline_ns.
  Status write_until(uint64_t deadline_ns);
  bool all_written() const { return written_ == bytes_.size(); }

  int descriptor_;
  std::string name_;
  std::string header_;            // empty once the reader has it
  std::vector<std::byte> bytes_;  // on their way
  size_t written_ = 0;            // of them
};

}  // namespace figurine::samples
