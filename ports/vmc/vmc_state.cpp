#include "ports/vmc/vmc_state.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace figurine::ports {

namespace {

constexpr double kShortest = 1e-6;  // quaternions
constexpr size_t kLongestName = 64;

// A name from outside, fit for a terminal and for a table of names.
std::string clean(std::string_view name) {
  std::string text(name.substr(0, kLongestName));
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

}  // namespace

struct VmcState::Reader final : OscVisitor {
  VmcState& state;
  uint64_t now_ns;
  Reader(VmcState& of, uint64_t now) : state(of), now_ns(now) {}

  void message(OscMessage message) override {
    ++state.counts_.messages;
    const std::string_view address = message.address();
    if (address == "/VMC/Ext/Bone/Pos") {
      state.take_transform(message, false, now_ns);
    } else if (address == "/VMC/Ext/Root/Pos") {
      state.take_transform(message, true, now_ns);
    } else if (address == "/VMC/Ext/Blend/Val") {
      state.take_channel(message);
    } else if (address == "/VMC/Ext/T") {
      OscArgument time;
      if (!message.next(time)) return;
      if (time.number < state.sender_time_s_) ++state.counts_.time_back;
      state.sender_time_s_ = time.number;
    }
  }
};

void VmcState::receive(std::span<const std::byte> packet, uint64_t now_ns) {
  ++counts_.packets;
  Reader reader(*this, now_ns);
  if (read_osc(packet, reader) != nullptr) ++counts_.malformed;
}

// A name and seven numbers: place, then quaternion xyzw. A root may bring six more (of version 2.1:
// the size of a room), which are not for us.
void VmcState::take_transform(OscMessage message, bool root, uint64_t now_ns) {
  OscArgument name, number;
  double v[7] = {};
  bool sound = message.next(name) && name.tag == 's';
  for (double& value : v) {
    sound = sound && message.next(number) && (number.tag == 'f' || number.tag == 'd');
    value = number.number;
  }
  size_t bone = 0;
  if (sound && !root) {
    const std::optional<size_t> found = humanoid_bone(name.text);
    sound = found.has_value();
    bone = found.value_or(0);
  }
  if (!sound) {
    ++counts_.unknown;
    return;
  }
  const glm::dvec3 place(v[0], v[1], v[2]);
  const glm::dquat turned(v[6], v[3], v[4], v[5]);
  const double length = std::sqrt(glm::dot(turned, turned));
  // Written so that NaN fails.
  if (!(glm::length(place) <= kFarthestPlace_m) ||
      !(length >= kShortest && length <= 1 / kShortest)) {
    ++counts_.dropped;
    return;
  }
  (root ? pose_.root : pose_.local[bone]) = mirror(turned / length);
  (root ? pose_.root_m : pose_.offset_m[bone]) = mirror(place);
  if (!root) pose_.has_offset[bone] = true;
  ++counts_.poses;
  newest_ns_ = now_ns;
}

void VmcState::take_channel(OscMessage message) {
  OscArgument name;
  if (!message.next(name) || name.tag != 's') {
    ++counts_.unknown;
    return;
  }
  if (channels_.size() >= kMostChannels) return;
  const auto [at, fresh] = channels_.insert(clean(name.text));
  if (fresh) new_channels_.push_back(*at);
}

double VmcState::presence(uint64_t now_ns) const {
  if (!newest_ns_) return 0;
  const double silent_s =
      now_ns > *newest_ns_ ? static_cast<double>(now_ns - *newest_ns_) * 1e-9 : 0;
  if (silent_s <= options_.hold_s) return 1;
  const double gone = std::clamp((silent_s - options_.hold_s) / options_.ease_s, 0.0, 1.0);
  return 1 - gone * gone * (3 - 2 * gone);
}

std::vector<std::string> VmcState::new_channels() { return std::exchange(new_channels_, {}); }

void ease_to_rest(double presence, std::span<float> rotations,
                  std::array<float, 3>& root_translation_m) {
  if (presence == 1) return;
  for (float& value : root_translation_m) value = static_cast<float>(value * presence);
  for (size_t j = 0; j < rotations.size() / 4; ++j) {
    float* q = &rotations[4 * j];
    // To the unturned rotation by the nearer way: from the one of q and -q whose w is positive.
    const double sign = q[0] < 0 ? -presence : presence;
    const glm::dquat blended = glm::normalize(
        glm::dquat(sign * q[0] + 1 - presence, sign * q[1], sign * q[2], sign * q[3]));
    q[0] = static_cast<float>(blended.w), q[1] = static_cast<float>(blended.x);
    q[2] = static_cast<float>(blended.y), q[3] = static_cast<float>(blended.z);
  }
}

}  // namespace figurine::ports
