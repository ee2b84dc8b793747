#include "samples/common/pose_rarity.h"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace figurine::samples {

std::string describe(const PoseRarity& rarity) {
  char text[96];
  std::snprintf(
      text, sizeof text, "at distance %.1f, %.0f %% of the training poses are farther out",
      static_cast<double>(rarity.distance), 100 * static_cast<double>(rarity.share_beyond));
  return text;
}

nlohmann::ordered_json rarity_json(const PoseRarity& rarity) {
  return {{"distance", rarity.distance}, {"share_beyond", rarity.share_beyond}};
}

}  // namespace figurine::samples
