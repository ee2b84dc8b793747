// A recipe that takes seconds: four mannequins at `nano`, swinging. Needs no data.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "ports/motion/motion_clip.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/error.h"

namespace figurine::testing_tools {

inline nlohmann::json small_recipe() {
  return nlohmann::json::parse(R"({
    "name": "small", "body": "mannequin", "preset": "nano", "seed": 5,
    "motions": [{"clip": "swinging.fgn"}],
    "capture": {"frames": 16, "views": 6, "size_px": 64},
    "groups": [{"split": "train", "first": 0, "count": 3},
               {"split": "test", "first": 10, "count": 1}],
    "initial_weights": {"identities": 2, "rounds": 2, "iterations": 20, "first_step": 0.5,
                        "last_step": 0.25},
    "training": {"iterations": 40},
    "evaluation": {"frozen": [10], "scratch": [10], "rounded": [10]}
  })");
}

// The same people, seen from near by as well, with one network for all and a static map each.
inline nlohmann::json small_shared_recipe() {
  nlohmann::json recipe = small_recipe();
  recipe.erase("initial_weights");
  recipe["capture"]["bust_views"] = 6;
  recipe["shared_network"] = {{"identities", 2}, {"iterations", 40}, {"poses", 2}};
  recipe["training"]["static_grids"] = "all:T";
  recipe["training"]["network_size"] = 16;
  return recipe;
}

// Its motion, which lies beside it.
inline void write_swinging_motion(const std::string& path) {
  ports::MotionClip clip;
  clip.name = "swinging";
  clip.frame_count = 40;
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    clip.root_translation_m.insert(clip.root_translation_m.end(), {0, 0, 0});
    for (uint32_t j = 0; j < body::kJointCount; ++j) {
      const double angle = 0.25 * std::sin(0.2 * f + 1.7 * j);
      clip.rotations.insert(clip.rotations.end(), {static_cast<float>(std::cos(angle / 2)),
                                                   static_cast<float>(std::sin(angle / 2)), 0, 0});
    }
  }
  throw_if_error(ports::write_file_atomically(
                     path, value_or_throw(write_package(clip.view(), {.tool = "test"}), path)),
                 path);
}

}  // namespace figurine::testing_tools
