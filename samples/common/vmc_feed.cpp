#include "samples/common/vmc_feed.h"

#include <nlohmann/json.hpp>

namespace figurine::samples {

namespace {

constexpr int kListen_ms = 100;  // how soon the thread sees that it shall end
constexpr uint64_t kGather_ns = 500'000'000;

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

class VmcFeed::Source final : public PoseSource {
 public:
  Source(const VmcFeed& feed, ports::HumanoidRig rig)
      : feed_(feed), rig_(std::move(rig)), pose_(rest_pose(rig_.joint_count())) {}
  Result<PoseView> next(double) override {
    rig_.to_body(feed_.shown_, pose_.rotations, pose_.root_translation_m);
    ports::ease_to_rest(feed_.presence_, pose_.rotations, pose_.root_translation_m);
    return pose_.view();
  }

 private:
  const VmcFeed& feed_;
  ports::HumanoidRig rig_;
  StoredPose pose_;
};

Result<std::unique_ptr<VmcFeed>> VmcFeed::open(const ports::UdpAddress& address,
                                               const Options& options) {
  Result<ports::UdpReceiver> receiver = ports::UdpReceiver::open(address);
  if (!receiver.ok()) return receiver.status();
  std::unique_ptr<VmcFeed> feed(new VmcFeed(std::move(receiver).value(), options));
  options.say("listening on vmc://" + feed->address().host + ":" +
              std::to_string(feed->address().port));
  return feed;
}

VmcFeed::~VmcFeed() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

Result<std::unique_ptr<PoseSource>> VmcFeed::source_for(const Body& body) {
  Result<ports::HumanoidRig> rig =
      ports::HumanoidRig::create(body.joint_names, body.mean_skeleton());
  if (!rig.ok()) return rig.status();
  return std::unique_ptr<PoseSource>(std::make_unique<Source>(*this, std::move(rig).value()));
}

void VmcFeed::start() {
  thread_ = std::thread([this] { run(); });
}

// Channels come a message each: those of the first half second are said in one line.
void VmcFeed::run() {
  std::vector<std::string> channels;
  uint64_t since_ns = 0;
  const auto say_channels = [&] {
    if (channels.empty()) return;
    options_.say("vmc: channels of expression that no avatar has, left out: " + joined(channels));
    channels.clear();
  };
  while (!stop_) {
    const Result<std::optional<std::span<const std::byte>>> datagram =
        receiver_.receive(kListen_ms);
    const uint64_t now_ns = options_.now_ns();
    if (!datagram.ok()) {
      const std::lock_guard lock(mutex_);
      broken_ = datagram.status();
      break;
    }
    if (*datagram) {
      const std::lock_guard lock(mutex_);
      state_.receive(**datagram, now_ns);
      for (std::string& name : state_.new_channels()) {
        if (channels.empty()) since_ns = now_ns;
        channels.push_back(std::move(name));
      }
    }
    if (now_ns - since_ns > kGather_ns) say_channels();
  }
  say_channels();
}

Status VmcFeed::advance(uint64_t now_ns) {
  const std::lock_guard lock(mutex_);
  shown_ = state_.pose();
  presence_ = state_.presence(now_ns);
  shown_ns_ = state_.newest_ns();
  return broken_;
}

nlohmann::ordered_json VmcFeed::counts() const {
  const std::lock_guard lock(mutex_);
  const ports::VmcState::Counts& counts = state_.counts();
  return {{"packets", counts.packets},     {"malformed", counts.malformed},
          {"messages", counts.messages},   {"poses", counts.poses},
          {"dropped", counts.dropped},     {"unknown", counts.unknown},
          {"time_back", counts.time_back}, {"channels", state_.channel_count()}};
}

std::string VmcFeed::summary() const {
  const std::lock_guard lock(mutex_);
  const ports::VmcState::Counts& counts = state_.counts();
  return std::to_string(counts.packets) + " datagrams, " + std::to_string(counts.malformed) +
         " malformed; " + std::to_string(counts.poses) + " rotations taken, " +
         std::to_string(counts.dropped) + " dropped";
}

}  // namespace figurine::samples
