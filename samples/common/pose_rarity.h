// How unusual a pose is (figurine/known_poses.h), in words and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "figurine/known_poses.h"

namespace figurine::samples {

// "at distance 7.1, 12 % of the training poses are farther out".
std::string describe(const PoseRarity& rarity);
// {"distance": 7.1, "share_beyond": 0.12}
nlohmann::ordered_json rarity_json(const PoseRarity& rarity);

}  // namespace figurine::samples
