// The devices that the emulator can be, and what a frame would take there: an estimate from the
// instructions that a frame of the shipped person took on emulated ARM cores, stage by stage, each
// scaled with the work that the stage has in the frame at hand. It says nothing of caches, of heat
// and of other programs; docs/emulator.md says how it is made.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "figurine/frame.h"
#include "samples/common/parse.h"

namespace figurine::emulator {

enum class Core : uint8_t { kHere, kA76, kA53 };

struct DeviceProfile {
  const char* name;               // in scripts
  const char* label;              // on the screen
  Core core;                      // kHere: this machine, as it is
  uint32_t cores;                 // 0: as many as there are
  double ghz;                     // of one
  double instructions_per_cycle;  // that frames reach on it
  const char* instruction_set;
  uint64_t memory_bytes;  // 0: not said
  samples::ImageSize screen;
};

std::span<const DeviceProfile> device_profiles();  // this machine first
// Null if there is none of this name.
const DeviceProfile* find_profile(std::string_view name);

// What the counts of docs/results/arm_instructions.json were made with, and they themselves.
struct CountedFrame {
  std::array<double, kStageCount> instructions;  // by the exact tier
  double fast_blend;                             // kBlend's, by the fast tier
};
struct CountedWork {
  double gaussians, visible, pairs, blends, fast_blends, macs, pixels;
};
const CountedFrame& counted_frame(Core core);  // not of kHere
const CountedWork& counted_work();

struct FrameEstimate {
  std::array<double, kStageCount> stage_ms{};
  double total_ms = 0;
};
// On one core of the device; none for this machine, whose frames are measured.
std::optional<FrameEstimate> estimate_frame(const DeviceProfile& profile,
                                            const FrameStatistics& statistics, uint64_t pixels,
                                            bool fast_blend);

}  // namespace figurine::emulator
