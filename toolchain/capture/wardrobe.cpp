#include "toolchain/capture/wardrobe.h"

#include <array>

namespace figurine::capture {
namespace {

// Fractions of the 512-pixel textures.
constexpr float px(float pixels) { return pixels / 512; }
Region box(float left, float top, float right, float bottom) { return {px(left), px(top), px(right), px(bottom)}; }

// Streams of the seed's choices: numbers that never change, so that a new choice does not redress everyone.
enum Choice : uint64_t {
  kGarment = 1,
  kShoes,
  kHairStyle,
  kHairTint,
  kBrows,
  kLashes,
  kEyes,
  kSkinVariant,
  kDyeTurn,
  kDyeSaturation,
  kDyeValue
};

const std::vector<Garment>& shoes() {
  static const std::vector<Garment> kShoes = {{"shoes01", {}, {}}, {"shoes02", {}, {}}, {"shoes03", {}, {}}, {"shoes04", {}, {}}};
  return kShoes;
}

template <class T>
const T& pick(const std::vector<T>& from, const Random& random, uint64_t choice) {
  return from[random.index(choice, from.size())];
}

// The skins' folders are AGE_ANCESTRY_GENDER; their textures name the tone instead.
std::string skin_texture(const std::string& age, const std::string& ancestry, const std::string& gender, bool second) {
  const std::string tone = ancestry == "african" ? "darkskinned" : "lightskinned";
  std::string number;
  if (ancestry == "asian") number = age == "young" ? "3" : "2";
  if (ancestry == "caucasian" && age == "young" && second) number = "2";
  return age + "_" + tone + "_" + gender + "_diffuse" + number + ".png";
}

}  // namespace

const std::vector<Garment>& garments_for(bool male) {
  static const std::vector<Garment> kMale = {
      {"male_casualsuit01", {}, {}},
      {"male_casualsuit02", {{box(248, 52, 324, 120), {0, px(68)}}}, {box(0, 0, 512, 201), box(392, 201, 512, 512)}},
      {"male_casualsuit03", {}, {}},
      {"male_casualsuit04", {{box(248, 52, 324, 120), {0, px(68)}}}, {box(0, 0, 512, 204)}},
      {"male_casualsuit05", {}, {}},
      {"male_casualsuit06", {{box(94, 50, 156, 96), {0, px(50)}}, {box(182, 54, 330, 110), {0, px(62)}}}, {}},
      {"male_elegantsuit01", {}, {}},
      {"male_worksuit01", {}, {}},
  };
  static const std::vector<Garment> kFemale = {
      {"female_casualsuit01", {{box(362, 68, 452, 168), {px(-88), 0}}}, {box(0, 0, 512, 218), box(376, 285, 512, 440)}},
      {"female_casualsuit02", {{box(362, 68, 452, 168), {px(-88), 0}}}, {box(0, 0, 512, 208), box(374, 285, 512, 440)}},
      {"female_elegantsuit01", {}, {}},
      {"female_sportsuit01", {}, {box(0, 0, 512, 218), box(376, 285, 512, 440)}},
  };
  return male ? kMale : kFemale;
}

const std::vector<Hair>& hair_for(bool male) {
  static const std::vector<Hair> kMale = {
      {"short01", "short01_diffuse.png", {{1, 1, 1}}},
      {"short02", "short02_diffuse.png", {{1, 1, 1}, {1.5f, 1.3f, 0.9f}, {0.5f, 0.4f, 0.35f}}},
      {"short03", "short03_diffuse.png", {{1, 1, 1}, {0.5f, 0.45f, 0.45f}, {1.2f, 0.8f, 0.55f}}},
      {"short04", "short04_diffuse.png", {{1, 1, 1}, {1.7f, 1.25f, 0.9f}}},
      {"afro01", "afro_diffuse.png", {{1, 1, 1}}},
  };
  static const std::vector<Hair> kFemale = {
      {"bob01", "bob01_diffuse.png", {{1, 1, 1}, {1.8f, 1.2f, 0.9f}}},
      {"bob02", "bob02_diffuse.png", {{1, 0.85f, 0.55f}, {0.45f, 0.27f, 0.15f}, {0.16f, 0.11f, 0.09f}, {0.75f, 0.5f, 0.28f}}},
      {"Braid01", "braid01_diffuse.png", {{1, 1, 1}}},
      {"long01", "long01_diffuse.png", {{1, 1, 1}, {0.45f, 0.4f, 0.4f}, {1.6f, 1.3f, 0.9f}}},
      {"ponytail01", "ponytail01_diffuse.png", {{1, 1, 1}, {0.5f, 0.45f, 0.45f}}},
      {"afro01", "afro_diffuse.png", {{1, 1, 1}}},
  };
  return male ? kMale : kFemale;
}

Outfit choose_outfit(const Random& random, const body::MacroShape& shape) {
  const bool male = shape.gender >= 0.5f;
  Outfit outfit;
  outfit.garment = &pick(garments_for(male), random, kGarment);
  outfit.shoes = &pick(shoes(), random, kShoes);
  const std::string gender = male ? "male" : "female";
  const std::string age = shape.age_years < 42 ? "young" : shape.age_years < 62 ? "middleage" : "old";
  std::string ancestry = "caucasian";
  if (shape.african >= shape.asian && shape.african >= shape.caucasian) {
    ancestry = "african";
  } else if (shape.asian >= shape.caucasian) {
    ancestry = "asian";
  }
  outfit.skin = age + "_" + ancestry + "_" + gender;
  outfit.skin_texture = skin_texture(age, ancestry, gender, random.unit(kSkinVariant) < 0.5);

  // An afro belongs to dark skin; dark skin and black hair keep their texture's own black.
  std::vector<const Hair*> styles;
  for (const Hair& hair : hair_for(male)) {
    if (std::string(hair.name) != "afro01" || ancestry == "african") styles.push_back(&hair);
  }
  outfit.hair = styles[random.index(kHairStyle, styles.size())];
  outfit.hair_tint = pick(outfit.hair->tints, random, kHairTint);
  if (age == "old") outfit.hair_tint = mix(outfit.hair_tint, {1.9f, 1.9f, 1.95f}, 0.6f);

  static const std::array<const char*, 12> kBrowStyles = {"eyebrow001", "eyebrow002", "eyebrow003", "eyebrow004",
                                                          "eyebrow005", "eyebrow006", "eyebrow007", "eyebrow008",
                                                          "eyebrow009", "eyebrow010", "eyebrow011", "eyebrow012"};
  static const std::array<const char*, 3> kLashStyles = {"eyelashes02", "eyelashes03", "eyelashes04"};
  static const std::array<const char*, 9> kIrises = {"brown",    "brownlight", "brown", "blue",     "bluegreen",
                                                     "deepblue", "green",      "grey",  "lightblue"};
  outfit.eyebrows = kBrowStyles[random.index(kBrows, kBrowStyles.size())];
  outfit.eyelashes = kLashStyles[random.index(kLashes, kLashStyles.size())];
  const size_t irises = ancestry == "caucasian" ? kIrises.size() : 3;
  outfit.eyes = std::string(kIrises[random.index(kEyes, irises)]) + "_eye.png";

  outfit.dye_turn_rad = static_cast<float>(random.uniform(kDyeTurn, -3.14159, 3.14159));
  outfit.dye_saturation = static_cast<float>(random.uniform(kDyeSaturation, 0.4, 0.75));
  outfit.dye_value = static_cast<float>(random.uniform(kDyeValue, 0.9, 1.3));
  return outfit;
}

}  // namespace figurine::capture
