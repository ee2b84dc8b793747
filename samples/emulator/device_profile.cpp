#include "samples/emulator/device_profile.h"

#include <algorithm>
#include <numeric>

#include "figurine/check.h"

namespace figurine::emulator {

namespace {

constexpr uint64_t kGB = 1'000'000'000;
// Clocks and instructions a cycle as in arm_instructions.json: a Raspberry Pi 5 has such an A76, a
// Raspberry Pi 3 B+ such an A53.
constexpr DeviceProfile kProfiles[] = {
    {"desk", "This machine", Core::kHere, 0, 0, 0, "the largest there is", 0, {720, 720}},
    {"a76-board", "Board, 4 x A76", Core::kA76, 4, 2.4, 2.0, "NEON, dot", 8 * kGB, {1280, 720}},
    {"a76-phone", "Phone, 2 x A76", Core::kA76, 2, 2.4, 2.0, "NEON, dot", 6 * kGB, {540, 960}},
    {"a53-board", "Board, 4 x A53", Core::kA53, 4, 1.4, 0.9, "NEON", 1 * kGB, {800, 480}},
    {"a53-panel", "Panel, 4 x A53", Core::kA53, 4, 1.4, 0.9, "NEON", kGB / 2, {480, 480}},
};

// docs/results/arm_instructions.json, cores.*.tiers; a test holds them against it.
constexpr CountedFrame kA76{
    {430002, 28338526, 2867242, 813566, 1615605, 1552132, 706926, 53542448, 2548642}, 36201873};
constexpr CountedFrame kA53{
    {430038, 86525174, 2867329, 813638, 1615654, 1552148, 706958, 53543429, 2548689}, 36202832};
constexpr CountedWork kWork{.gaussians = 8239,
                            .visible = 8196,
                            .pairs = 19370,
                            .blends = 1396076,
                            .fast_blends = 1003334,
                            .macs = 243662848,
                            .pixels = 512.0 * 512.0};

// How much more of a stage's work there is than in the frame that was counted. Maps and network go
// with the network's size, which is its multiplications; the rest with what it loops over.
double share(Stage stage, const FrameStatistics& statistics, uint64_t pixels, bool fast_blend) {
  const auto of = [](uint64_t now, double then) { return static_cast<double>(now) / then; };
  switch (stage) {
    case Stage::kMaps:
    case Stage::kNetwork:
      return of(statistics.macs, kWork.macs);
    case Stage::kDecode:
    case Stage::kSkin:
    case Stage::kProject:
      return of(statistics.gaussians, kWork.gaussians);
    case Stage::kBin:
      return of(statistics.pairs, kWork.pairs);
    case Stage::kSort:
      return of(statistics.visible, kWork.visible);
    case Stage::kBlend:
      return of(statistics.blends, fast_blend ? kWork.fast_blends : kWork.blends);
    case Stage::kResolve:
      return of(pixels, kWork.pixels);
  }
  return 0;
}

}  // namespace

std::span<const DeviceProfile> device_profiles() { return kProfiles; }

const DeviceProfile* find_profile(std::string_view name) {
  const auto at = std::find_if(std::begin(kProfiles), std::end(kProfiles),
                               [&](const DeviceProfile& each) { return each.name == name; });
  return at == std::end(kProfiles) ? nullptr : at;
}

const CountedFrame& counted_frame(Core core) {
  FIG_CHECK(core != Core::kHere, "a core whose instructions were counted");
  return core == Core::kA76 ? kA76 : kA53;
}

const CountedWork& counted_work() { return kWork; }

std::optional<FrameEstimate> estimate_frame(const DeviceProfile& profile,
                                            const FrameStatistics& statistics, uint64_t pixels,
                                            bool fast_blend) {
  if (profile.core == Core::kHere) return std::nullopt;
  const CountedFrame& counted = counted_frame(profile.core);
  FrameEstimate estimate;
  for (size_t i = 0; i < kStageCount; ++i) {
    const auto stage = static_cast<Stage>(i);
    const double instructions =
        fast_blend && stage == Stage::kBlend ? counted.fast_blend : counted.instructions[i];
    estimate.stage_ms[i] = instructions * share(stage, statistics, pixels, fast_blend) /
                           (profile.ghz * profile.instructions_per_cycle * 1e6);
  }
  estimate.total_ms = std::accumulate(estimate.stage_ms.begin(), estimate.stage_ms.end(), 0.0);
  return estimate;
}

}  // namespace figurine::emulator
