// Pictures for the inspector's page, drawn by the runtime: an avatar's golden frame, people that a
// sampler draws, members of a population, a body, a motion on its body.
#pragma once

#include <string>
#include <vector>

#include "samples/common/loading.h"

namespace figurine::inspect {

struct Picture {
  std::string caption;
  std::vector<std::byte> png;
};

struct PictureSection {
  std::string title;
  std::string words;  // of all of them; or why there are none
  std::vector<Picture> pictures;
};

// body: as --body: that of a motion, which is drawn on it, or of what stands on one (empty: found
// by its hash). What cannot be drawn is a section that says so, never an error: a package is sound
// without its body. Except kInterrupted.
Result<std::vector<PictureSection>> draw_pictures(const samples::LoadedPackage& package,
                                                  const std::string& body);

}  // namespace figurine::inspect
