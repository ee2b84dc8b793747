// One member of a population, from nothing to its avatar package: its person is captured, its UNet
// trained from the shared initial weights, measured against the truth, packed; then run and capture
// are removed.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "ports/motion/motion_clip.h"
#include "toolchain/population/recipe.h"
#include "toolchain/population/state.h"
#include "toolchain/train/package_file.h"

namespace figurine::population {

// What all members share. Borrowed; nothing in it belongs to LibTorch, so it can be made before
// processes are forked.
struct Workshop {
  const Recipe& recipe;
  const State& state;
  const train::PackageFile& body;
  const std::vector<ports::MotionClip>& motions;
  const std::vector<std::string>& sources;  // of the motions
  std::string makehuman;
  bool keep_captures = false;  // of members that are done
};

// Makes the capture of an identity in folder/ID, or finishes it. One thread. Throws InputError or
// Interrupted.
void capture_identity(const Workshop& workshop, const Identity& identity,
                      const std::string& folder);

// Makes the member, or goes on where it was interrupted, and returns its row: what members/ID.json
// holds. A member that is there already is not made again. One thread.
nlohmann::json make_member(const Workshop& workshop, const Identity& identity);

}  // namespace figurine::population
