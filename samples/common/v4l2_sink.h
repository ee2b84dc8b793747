// Live video into a video device: what stands behind "/dev/video0".
#pragma once

#include <memory>
#include <string>

#include "ports/v4l2/v4l2_output.h"
#include "samples/common/live_sink.h"

namespace figurine::samples {

class V4l2Sink final : public LiveSink {
 public:
  // Errors: V4l2Output::open. system: null for the machine's own.
  static Result<std::unique_ptr<V4l2Sink>> open(const std::string& path, ImageSize size,
                                                const Options& options,
                                                ports::VideoSystem* system = nullptr);
  PixelFormat format() const override { return output_->format(); }
  YcbcrMatrix matrix() const override { return ports::V4l2Output::kMatrix; }

 private:
  V4l2Sink(std::unique_ptr<ports::V4l2Output> output, const Options& options)
      : LiveSink(options), output_(std::move(output)) {}
  Result<bool> put(const RenderedFrame& frame, uint64_t deadline_ns) override;

  std::unique_ptr<ports::V4l2Output> output_;
};

}  // namespace figurine::samples
