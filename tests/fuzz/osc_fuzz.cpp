// Any bytes as a datagram: refused, or read without a step beyond their end; and what a sender says
// with them leaves a pose that a body can take. tests/fuzz/seeds/osc is the seed corpus.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>

#include "ports/vmc/smplx_figure.h"
#include "ports/vmc/vmc_state.h"

namespace {

using namespace figurine;

void check(bool holds) {
  if (!holds) std::abort();
}

const tests::SmplxFigure& figure() {
  static const tests::SmplxFigure made;
  return made;
}

const ports::HumanoidRig& rig() {
  static const ports::HumanoidRig made =
      std::move(ports::HumanoidRig::create(figure().names(), figure().rest())).value();
  return made;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // A copy of exactly this size: a sanitizer sees every byte read beyond it.
  const std::unique_ptr<std::byte[]> bytes(new std::byte[size]);
  if (size > 0) std::memcpy(bytes.get(), data, size);
  ports::VmcState state;
  state.receive({bytes.get(), size}, 1);
  check(state.counts().malformed <= 1 && state.counts().packets == 1);
  check(state.channel_count() <= ports::VmcState::kMostChannels);
  for (const std::string& name : state.new_channels()) {
    for (const char c : name) check(c >= ' ' && c <= '~');
  }
  if (state.counts().poses == 0) return 0;  // the pose is that of every other such input
  std::vector<float> rotations(4 * figure().count());
  std::array<float, 3> root{};
  for (const uint64_t now_ns : {uint64_t{0}, uint64_t{1}, uint64_t{2'000'000'000}, UINT64_MAX}) {
    rig().to_body(state.pose(), rotations, root);
    ports::ease_to_rest(state.presence(now_ns), rotations, root);
    check(validate_pose({root, rotations}, static_cast<uint32_t>(figure().count())).ok());
  }
  return 0;
}
