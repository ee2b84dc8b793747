// Poses from a performer who sends VMC over UDP (ports/vmc), for every figure whose body has the
// humanoid joints. Faces: channels of expression that arrive are said once each, as no avatar has
// any.
#pragma once

#include "ports/vmc/udp.h"
#include "ports/vmc/vmc_state.h"
#include "samples/common/pose_feed.h"

namespace figurine::samples {

class VmcFeed final : public PoseFeed {
 public:
  struct Options {
    ports::VmcState::Options state;
    void (*say)(const std::string& line) = ports::say;
    uint64_t (*now_ns)();  // of arrivals
  };
  // Binds, and says where. Errors: UdpReceiver::open.
  static Result<std::unique_ptr<VmcFeed>> open(const ports::UdpAddress& address,
                                               const Options& options);
  ~VmcFeed() override;

  const ports::UdpAddress& address() const { return receiver_.address(); }
  Result<std::unique_ptr<PoseSource>> source_for(const Body& body) override;
  void start() override;
  Status advance(uint64_t now_ns) override;
  std::optional<uint64_t> arrived_ns() const override { return shown_ns_; }
  bool ended() const override { return false; }  // a performer may always come back
  nlohmann::ordered_json counts() const override;
  std::string summary() const override;

 private:
  class Source;
  VmcFeed(ports::UdpReceiver receiver, const Options& options)
      : options_(options), receiver_(std::move(receiver)), state_(options.state) {}
  void run();

  Options options_;
  ports::UdpReceiver receiver_;
  // What the sources give now.
  ports::HumanoidPose shown_;
  double presence_ = 0;
  std::optional<uint64_t> shown_ns_;

  mutable std::mutex mutex_;  // of what follows
  ports::VmcState state_;
  Status broken_;

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace figurine::samples
