// What a VMC sender has said so far: datagrams in, a pose of the humanoid bones out. No socket and
// no clock: the caller brings bytes and their time, so that everything can be played again in a
// test.
//
// The newest value of every bone counts; senders spread a pose over many messages and datagrams and
// not all mark its end, so none is waited for. Values that are none (NaN, a quaternion of no
// length, a place a kilometre away) are dropped and counted, and the value before them stays. A
// sender that falls silent is held where it is, then eased to rest.
//
// Read: /VMC/Ext/Root/Pos, /VMC/Ext/Bone/Pos, /VMC/Ext/Blend/Val, /VMC/Ext/Blend/Apply, /VMC/Ext/OK
// and /VMC/Ext/T, the latter for counting alone: what a sender's clock does changes nothing. Every
// other message is left alone.
//
// Based on: VirtualMotionCapture protocol, "Marionette" (performer to viewer), versions 2.0 to 2.7.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "ports/vmc/humanoid.h"
#include "ports/vmc/osc.h"

namespace figurine::ports {

class VmcState {
 public:
  struct Options {
    double hold_s = 1;  // silent for so long: still there
    double ease_s = 2;  // from then on the way to rest takes so long
  };
  struct Counts {
    uint64_t packets = 0;    // datagrams
    uint64_t malformed = 0;  // of them: no OSC
    uint64_t messages = 0;   // of the sound ones
    uint64_t poses = 0;      // values of bones and roots that were taken
    uint64_t dropped = 0;    // that were no rotation or no place
    uint64_t unknown = 0;    // bones that the humanoid set does not have, and VMC messages with
                             // other arguments than theirs
    uint64_t time_back = 0;  // times that the sender's clock went back
  };

  VmcState() = default;
  explicit VmcState(const Options& options) : options_(options) {}

  // Takes a datagram that came at now_ns. What it says of itself is never believed.
  void receive(std::span<const std::byte> packet, uint64_t now_ns);

  // When a bone or a root was taken last; none: never.
  std::optional<uint64_t> newest_ns() const { return newest_ns_; }
  // 1 as long as the sender speaks and hold_s after, then falling to 0, smoothly; 0 before it has
  // spoken. Any now_ns is fine, an earlier one than a packet's too.
  double presence(uint64_t now_ns) const;
  const HumanoidPose& pose() const { return pose_; }
  const Counts& counts() const { return counts_; }

  // Expression channels that have come since the last call, each once and fit for a terminal. After
  // kMostChannels different ones no more are told apart.
  std::vector<std::string> new_channels();
  static constexpr size_t kMostChannels = 256;
  size_t channel_count() const { return channels_.size(); }

 private:
  struct Reader;
  void take_transform(OscMessage message, bool root, uint64_t now_ns);
  void take_channel(OscMessage message);

  Options options_;
  HumanoidPose pose_;
  Counts counts_;
  std::optional<uint64_t> newest_ns_;
  double sender_time_s_ = 0;
  std::set<std::string, std::less<>> channels_;
  std::vector<std::string> new_channels_;
};

// A body's pose on its way to rest, which presence 1 leaves as it is and 0 makes: the root's way
// and every joint's rotation, by the shorter arc (normalised linear blend). rotations: [J,4] unit.
void ease_to_rest(double presence, std::span<float> rotations,
                  std::array<float, 3>& root_translation_m);

}  // namespace figurine::ports
