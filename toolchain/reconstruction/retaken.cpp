#include "toolchain/reconstruction/retaken.h"

#include <algorithm>

#include "toolchain/error.h"

namespace figurine::reconstruction {

measure::Picture picture_of(const capture::Rendering& rendering) {
  measure::Picture picture{rendering.colour.width_px, rendering.colour.height_px,
                           std::vector<uint8_t>(rendering.alpha.pixels.size() * 4)};
  for (size_t i = 0; i < rendering.alpha.pixels.size(); ++i) {
    std::copy_n(&rendering.colour.pixels[3 * i], 3, &picture.rgba[4 * i]);
    picture.rgba[4 * i + 3] = rendering.alpha.pixels[i];
  }
  return picture;
}

std::vector<size_t> choose_cameras(const dataset::Dataset& data, dataset::Framing framing,
                                   uint32_t count) {
  std::vector<size_t> chosen;
  for (const bool held_out : {true, false}) {
    std::vector<size_t> cameras;
    for (size_t c = 0; c < data.cameras().size(); ++c) {
      const dataset::CaptureCamera& camera = data.cameras()[c];
      if (camera.framing == framing && camera.held_out == held_out) cameras.push_back(c);
    }
    const size_t n = std::min<size_t>(count - chosen.size(), cameras.size());
    for (size_t i = 0; i < n; ++i) chosen.push_back(cameras[i * cameras.size() / n]);
  }
  return chosen;
}

void check_retakable(const dataset::Dataset& data) {
  if (data.sources().empty())
    throw InputError(data.directory() + ": its person cannot be photographed again");
}

}  // namespace figurine::reconstruction
