#include "samples/common/y4m_pipe.h"

#include <limits.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace figurine::samples {

namespace {

constexpr uint64_t kFinishWait_ns = 1'000'000'000;

}  // namespace

Result<std::unique_ptr<Y4mPipe>> Y4mPipe::create(int descriptor, const std::string& name,
                                                 ImageSize size, const Options& options) {
  const Result<ports::FrameRate> rate = ports::make_frame_rate(options.frames_per_second);
  if (!rate.ok()) return rate.status().within(name);
  std::unique_ptr<Y4mPipe> pipe(new Y4mPipe(descriptor, name, options));
  pipe->header_ = ports::y4m_header(size.width_px, size.height_px, *rate);
  return pipe;
}

Result<bool> Y4mPipe::put(const RenderedFrame& frame, uint64_t deadline_ns) {
  FIG_RETURN_IF_ERROR(write_until(deadline_ns));
  if (!all_written()) return false;
  const std::span<const std::byte> header = std::as_bytes(std::span(header_));
  bytes_.assign(header.begin(), header.end());
  written_ = 0;
  ports::append_y4m_frame(frame.u8, bytes_);
  FIG_RETURN_IF_ERROR(write_until(deadline_ns));
  if (written_ == 0) {  // nobody has seen anything of it
    bytes_.clear();
    return false;
  }
  header_.clear();
  return true;
}

// Where poll() finds room there is some for PIPE_BUF bytes, and a write of no more than that does
// not wait: the pipe need not be made non-blocking.
Status Y4mPipe::write_until(uint64_t deadline_ns) {
  const auto failed = [&] { return Status(StatusCode::kIo, name_ + ": " + std::strerror(errno)); };
  while (!all_written()) {
    const uint64_t now = now_ns(), left_ns = deadline_ns > now ? deadline_ns - now : 0;
    pollfd waiting{.fd = descriptor_, .events = POLLOUT, .revents = 0};
    const int ready =
        ::poll(&waiting, 1,
               static_cast<int>(std::min<uint64_t>((left_ns + 999'999) / 1'000'000, INT_MAX)));
    if (ready < 0 && errno != EINTR) return failed();
    if (ready > 0) {
      const ssize_t count = ::write(descriptor_, bytes_.data() + written_,
                                    std::min<size_t>(bytes_.size() - written_, PIPE_BUF));
      if (count < 0 && errno != EINTR && errno != EAGAIN) return failed();
      written_ += static_cast<size_t>(std::max<ssize_t>(count, 0));
    }
    if (now_ns() >= deadline_ns) return {};
  }
  return {};
}

Status Y4mPipe::finish() {
  FIG_RETURN_IF_ERROR(write_until(now_ns() + kFinishWait_ns));
  return all_written() ? Status()
                       : Status(StatusCode::kIo, name_ + ": the reader stopped inside a frame");
}

}  // namespace figurine::samples
