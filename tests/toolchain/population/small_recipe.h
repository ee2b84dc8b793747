// A recipe that takes seconds: four mannequins at `nano`, swinging. Needs no data.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace figurine::testing_tools {

inline nlohmann::json small_recipe() {
  return nlohmann::json::parse(R"({
    "name": "small", "body": "mannequin", "preset": "nano", "seed": 5,
    "motions": [{"clip": "swinging.fgn"}],
    "capture": {"frames": 16, "views": 6, "size_px": 64},
    "groups": [{"split": "train", "first": 0, "count": 3}, {"split": "test", "first": 10, "count": 1}],
    "initial_weights": {"identities": 2, "rounds": 2, "iterations": 20, "first_step": 0.5, "last_step": 0.25},
    "training": {"iterations": 40},
    "evaluation": {"frozen": [10], "scratch": [10], "rounded": [10]}
  })");
}

}  // namespace figurine::testing_tools
