#include "toolchain/capture/wardrobe.h"

#include <algorithm>
#include <array>

#include "toolchain/error.h"
#include "toolchain/random/counter.h"

namespace figurine::capture {

using random::CounterRandom;

namespace {

// Fractions of the 512-pixel textures.
constexpr float px(float pixels) { return pixels / 512; }
Region box(float left, float top, float right, float bottom) {
  return {px(left), px(top), px(right), px(bottom)};
}

// Streams of a person's seed. What came later has streams of its own, so that shape, garment and
// hair style of a seed stay what they were.
constexpr uint64_t kWardrobeStream = 2, kColourStream = 6, kLimitStream = 7;

// Streams of the seed's choices: numbers that never change, so that a new choice does not redress
// everyone.
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

// Counters of kColourStream. Fabrics take three each.
enum Colour : uint64_t {
  kSkinLight = 1,
  kSkinWarm,
  kHairColour,
  kHairLight,
  kHairWarm,
  kHairGrey,
  kEyeLight,
  kFirstFabric = 16
};

// How cloths fall: denim is stiff, T-shirts are thin and gather in many small folds, suits are
// lined.
constexpr FoldStyle kTShirtAndJeans{.wavelength_m = 0.046f, .slack = 0.020f, .strength = 1.0f};
constexpr FoldStyle kShirt{.wavelength_m = 0.042f, .slack = 0.022f, .strength = 1.0f};
constexpr FoldStyle kJacket{.wavelength_m = 0.056f, .slack = 0.015f, .strength = 0.9f};
constexpr FoldStyle kOveralls{.wavelength_m = 0.052f, .slack = 0.020f, .strength = 1.0f};
constexpr FoldStyle kSports{.wavelength_m = 0.040f, .slack = 0.012f, .strength = 0.9f};

// Luma of the undyed cloths.
constexpr float kDenim = 0.42f, kVest = 0.29f, kBlackSuit = 0.20f, kWhiteShirt = 0.82f;

const std::vector<Garment>& shoes() {
  static const std::vector<Garment> kShoes = {
      {"shoes01",
       {},
       {},
       {},
       {{box(0, 0, 420, 160), Fibre::kAll, Fabric::kLeather, 0.40f},
        {box(0, 160, 512, 512), Fibre::kAll, Fabric::kLeather, 0.40f}}},
      {"shoes02", {}, {}, {}, {{box(0, 0, 512, 430), Fibre::kAll, Fabric::kLeather, 0.38f}}},
      {"shoes03", {}, {}, {}, {}},
      {"shoes04",
       {},
       {},
       {},
       {{box(0, 0, 420, 160), Fibre::kAll, Fabric::kLeather, 0.22f},
        {box(0, 160, 512, 512), Fibre::kAll, Fabric::kLeather, 0.22f}}}};
  return kShoes;
}

struct Dye {
  float red, green, blue;  // 8-bit sRGB
};

// Dyes that such things are sold in.
const std::vector<Dye>& dyes_of(Fabric fabric) {
  static const std::vector<Dye> kShirtDyes = {{205, 205, 200}, {170, 60, 55},   {60, 95, 150},
                                              {70, 120, 85},   {215, 190, 120}, {120, 80, 130},
                                              {225, 150, 90},  {70, 70, 78},    {150, 185, 205},
                                              {190, 120, 135}, {95, 140, 140},  {130, 110, 90}};
  static const std::vector<Dye> kTrouserDyes = {{52, 62, 90},    {42, 42, 46}, {105, 106, 110},
                                                {165, 147, 115}, {92, 72, 56}, {88, 92, 66},
                                                {190, 182, 165}, {96, 46, 50}};
  static const std::vector<Dye> kSuitDyes = {{58, 60, 66},    {40, 50, 82},    {86, 68, 54},
                                             {110, 112, 116}, {150, 134, 108}, {84, 42, 50},
                                             {58, 76, 66}};
  static const std::vector<Dye> kLeatherDyes = {{46, 42, 40}, {92, 58, 38},    {150, 108, 70},
                                                {98, 42, 38}, {112, 110, 108}, {196, 190, 180},
                                                {52, 60, 84}};
  switch (fabric) {
    case Fabric::kShirt:
      return kShirtDyes;
    case Fabric::kTrousers:
      return kTrouserDyes;
    case Fabric::kSuit:
      return kSuitDyes;
    case Fabric::kLeather:
      break;
  }
  return kLeatherDyes;
}

template <class T>
const T& pick(const std::vector<T>& from, const CounterRandom& random, uint64_t choice) {
  return from[random.index(choice, from.size())];
}

// The skins' folders are AGE_ANCESTRY_GENDER; their textures name the tone instead.
Skin make_skin(const std::string& age, const std::string& ancestry, bool male, bool second) {
  const std::string tone = ancestry == "african" ? "darkskinned" : "lightskinned",
                    gender = male ? "male" : "female";
  std::string number;
  if (ancestry == "asian") number = age == "young" ? "3" : "2";
  if (ancestry == "caucasian" && age == "young" && second) number = "2";
  return {age + "_" + ancestry + "_" + gender,
          age + "_" + tone + "_" + gender + "_diffuse" + number + ".png", age, tone, male};
}

bool contains(const std::vector<std::string>& list, const std::string& name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

std::string quoted(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "'" : ", '") + name + "'";
  return out;
}

// What limits leave of a list, in the list's order. InputError if that is nothing.
template <class T, class Name>
std::vector<const T*> allowed(const std::vector<T>& all, const std::vector<std::string>& only,
                              const std::vector<std::string>& excluded, const std::string& option,
                              bool male, Name name) {
  std::vector<const T*> left;
  for (const T& item : all) {
    if ((only.empty() || contains(only, name(item))) && !contains(excluded, name(item)))
      left.push_back(&item);
  }
  if (!left.empty()) return left;
  const std::string person = male ? "this man" : "this woman";
  if (only.empty()) throw InputError("--exclude-" + option + "s: leaves nothing for " + person);
  throw InputError("--" + option + ": " + quoted(only) +
                   (excluded.empty() ? "" : " without what is excluded") + " holds nothing for " +
                   person);
}

// Names that no person could have are mistakes, whoever is dressed.
void require_known(const WardrobeLimits& limits) {
  std::vector<std::string> garments, textures, hairs;
  for (bool male : {false, true}) {
    for (const Garment& garment : garments_for(male)) garments.push_back(garment.name);
    for (const Hair& hair : hair_for(male)) hairs.push_back(hair.name);
  }
  for (const Skin& skin : skins()) textures.push_back(skin.name());
  const auto check = [](const char* option, const std::vector<std::string>& names,
                        const std::vector<std::string>& known) {
    for (const std::string& name : names) {
      if (!contains(known, name))
        throw InputError(std::string(option) + ": '" + name + "' is not in the wardrobe");
    }
  };
  check("--outfit", limits.outfits, garments);
  check("--exclude-outfits", limits.excluded_outfits, garments);
  check("--skin", limits.skins, textures);
  check("--exclude-skins", limits.excluded_skins, textures);
  if (!limits.hair.empty()) check("--hair", {limits.hair}, hairs);
}

// The colours that came after the wardrobe: of cloths, skin, hair and eyes, each in its plausible
// range.
void choose_colours(const CounterRandom& random, const body::MacroShape& shape,
                    const std::string& ancestry, Outfit& outfit) {
  for (size_t f = 0; f < kFabrics; ++f) {
    const uint64_t counter = kFirstFabric + 4 * f;
    const std::vector<Dye>& dyes = dyes_of(static_cast<Fabric>(f));
    const Dye& dye = dyes[random.index(counter, dyes.size())];
    const auto light = static_cast<float>(random.uniform(counter + 1, 0.85, 1.15));
    outfit.dye[f] = Vec3{dye.red, dye.green, dye.blue} * (light / 255);
    // A third keeps the photographed cloth; the others keep a little of it, as dyed cloth does.
    outfit.dye_amount[f] = random.unit(counter + 2) < 0.33
                               ? 0
                               : static_cast<float>(random.uniform(counter + 3, 0.8, 1.0));
  }
  const auto warm = [&](uint64_t counter, float range) {
    const auto w = static_cast<float>(random.uniform(counter, -1, 1)) * range;
    return Vec3{1 + w, 1, 1 - w};
  };
  outfit.skin_tint =
      warm(kSkinWarm, 0.04f) * static_cast<float>(random.uniform(kSkinLight, 0.84, 1.08));
  const auto eye = static_cast<float>(random.uniform(kEyeLight, 0.85, 1.1));
  outfit.eye_tint = {eye, eye, eye};

  // Multiplied with the style's own tint: as it is, dark, auburn, ash.
  static const std::array<Vec3, 4> kShades = {Vec3{1, 1, 1}, Vec3{0.55f, 0.48f, 0.44f},
                                              Vec3{1.25f, 0.85f, 0.6f}, Vec3{0.85f, 0.82f, 0.8f}};
  const size_t shades = ancestry == "caucasian" ? kShades.size() : 2;
  const Vec3 hair = kShades[random.index(kHairColour, shades)] * warm(kHairWarm, 0.06f) *
                    static_cast<float>(random.uniform(kHairLight, 0.8, 1.2));
  // The lighter tints are those of light hair: on others they would look like a wig.
  if (ancestry != "caucasian") {
    const float light = 0.8f * (outfit.hair_tint.x + outfit.hair_tint.y + outfit.hair_tint.z) / 3;
    outfit.hair_tint = mix(outfit.hair_tint, {light, light, light}, 0.7f) * 0.8f;
  }
  // Grey comes with the years, earlier for some.
  const double grey =
      std::clamp((shape.age_years - random.uniform(kHairGrey, 40, 75)) / 25.0, 0.0, 0.75);
  outfit.hair_tint = mix(outfit.hair_tint * hair, {1.7f, 1.7f, 1.75f}, static_cast<float>(grey));
}

}  // namespace

const std::vector<Garment>& garments_for(bool male) {
  static const std::vector<Garment> kMale = {
      {"male_casualsuit01",
       {},
       {},
       kShirt,
       {{box(182, 0, 366, 512), Fibre::kAll, Fabric::kTrousers, 0.30f},
        {box(0, 156, 182, 512), Fibre::kAll, Fabric::kShirt, 0.28f},
        {box(366, 100, 512, 512), Fibre::kAll, Fabric::kShirt, 0.28f}}},
      {"male_casualsuit02",
       {{box(248, 52, 324, 120), {0, px(68)}}},
       {box(0, 0, 512, 201), box(392, 201, 512, 512)},
       kTShirtAndJeans,
       {{box(0, 204, 392, 512), Fibre::kAll, Fabric::kTrousers, kDenim}}},
      {"male_casualsuit03",
       {},
       {},
       kShirt,
       {{box(20, 0, 405, 300), Fibre::kNotRed, Fabric::kTrousers, kDenim},
        {box(0, 0, 512, 512), Fibre::kRed, Fabric::kShirt, 0.32f}}},
      {"male_casualsuit04",
       {{box(248, 52, 324, 120), {0, px(68)}}},
       {box(0, 0, 512, 204)},
       kTShirtAndJeans,
       {{box(0, 207, 512, 512), Fibre::kAll, Fabric::kTrousers, kDenim}}},
      {"male_casualsuit05",
       {},
       {},
       kJacket,
       {{box(0, 284, 300, 512), Fibre::kNotRed, Fabric::kTrousers, kDenim},
        {box(0, 0, 512, 284), Fibre::kNeutral, Fabric::kSuit, kVest},
        {box(300, 284, 512, 512), Fibre::kNeutral, Fabric::kSuit, kVest},
        {box(0, 0, 512, 512), Fibre::kRed, Fabric::kShirt, 0.32f}}},
      {"male_casualsuit06",
       {{box(94, 50, 156, 96), {0, px(50)}}, {box(182, 54, 330, 110), {0, px(62)}}},
       {},
       kTShirtAndJeans,
       {{box(0, 0, 512, 226), Fibre::kAll, Fabric::kShirt, kWhiteShirt},
        {box(0, 226, 512, 512), Fibre::kAll, Fabric::kTrousers, kDenim}}},
      {"male_elegantsuit01",
       {},
       {},
       kJacket,
       {{box(0, 0, 160, 512), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(160, 240, 384, 512), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(262, 0, 512, 238), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        // The front's other half, around the collar and the tie.
        {box(244, 44, 262, 64), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(220, 54, 244, 64), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(212, 64, 262, 240), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(192, 100, 212, 240), Fibre::kDark, Fabric::kSuit, kBlackSuit},
        {box(384, 364, 512, 512), Fibre::kDark, Fabric::kSuit, kBlackSuit}}},
      {"male_worksuit01",
       {},
       {},
       kOveralls,
       {{box(0, 0, 512, 512), Fibre::kBlue, Fabric::kTrousers, 0.60f}}},
  };
  static const std::vector<Garment> kFemale = {
      {"female_casualsuit01",
       {{box(362, 68, 452, 168), {px(-88), 0}}},
       {box(0, 0, 512, 218), box(376, 285, 512, 440)},
       kTShirtAndJeans,
       {{box(0, 220, 374, 512), Fibre::kAll, Fabric::kTrousers, kDenim}}},
      {"female_casualsuit02",
       {{box(362, 68, 452, 168), {px(-88), 0}}},
       {box(0, 0, 512, 208), box(374, 285, 512, 440)},
       kTShirtAndJeans,
       {{box(0, 210, 372, 512), Fibre::kAll, Fabric::kTrousers, 0.47f}}},
      {"female_elegantsuit01",
       {},
       {},
       kShirt,
       {{box(0, 0, 400, 262), Fibre::kNeutral, Fabric::kSuit, kVest},
        {box(0, 0, 512, 512), Fibre::kRed, Fabric::kShirt, 0.32f}}},
      {"female_sportsuit01",
       {},
       {box(0, 0, 512, 218), box(376, 285, 512, 440)},
       kSports,
       {{box(0, 220, 374, 512), Fibre::kDark, Fabric::kTrousers, kBlackSuit}}},
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
      {"bob02",
       "bob02_diffuse.png",
       {{1, 0.85f, 0.55f}, {0.45f, 0.27f, 0.15f}, {0.16f, 0.11f, 0.09f}, {0.75f, 0.5f, 0.28f}}},
      {"Braid01", "braid01_diffuse.png", {{1, 1, 1}}},
      {"long01", "long01_diffuse.png", {{1, 1, 1}, {0.45f, 0.4f, 0.4f}, {1.6f, 1.3f, 0.9f}}},
      {"ponytail01", "ponytail01_diffuse.png", {{1, 1, 1}, {0.5f, 0.45f, 0.45f}}},
      {"afro01", "afro_diffuse.png", {{1, 1, 1}}},
  };
  return male ? kMale : kFemale;
}

const std::vector<Skin>& skins() {
  static const std::vector<Skin> kSkins = [] {
    std::vector<Skin> all;
    for (bool male : {false, true}) {
      for (const char* age : {"young", "middleage", "old"}) {
        for (const char* ancestry : {"african", "asian", "caucasian"})
          all.push_back(make_skin(age, ancestry, male, false));
      }
      all.push_back(make_skin("young", "caucasian", male, true));
    }
    return all;
  }();
  return kSkins;
}

namespace {

const Garment* choose_garment(const CounterRandom& first, const CounterRandom& again, bool male,
                              const WardrobeLimits& limits) {
  const Garment* own = &pick(garments_for(male), first, kGarment);
  const auto left = allowed(garments_for(male), limits.outfits, limits.excluded_outfits, "outfit",
                            male, [](const Garment& g) { return g.name; });
  if (std::find(left.begin(), left.end(), own) != left.end()) return own;
  return left[again.index(kGarment, left.size())];
}

// Where the person's own skin is not allowed, one of the same sex that looks most alike: age and
// tone before tone before any.
Skin choose_skin(const Skin& own, const CounterRandom& again, const WardrobeLimits& limits) {
  std::vector<Skin> of_sex;
  for (const Skin& skin : skins()) {
    if (skin.male == own.male) of_sex.push_back(skin);
  }
  const auto left = allowed(of_sex, limits.skins, limits.excluded_skins, "skin", own.male,
                            [](const Skin& s) { return s.name(); });
  std::vector<const Skin*> best;
  int most_alike = -1;
  for (const Skin* skin : left) {
    if (skin->texture == own.texture) return own;
    const int alike = 2 * (skin->tone == own.tone) + (skin->age == own.age);
    if (alike > most_alike) best.clear(), most_alike = alike;
    if (alike == most_alike) best.push_back(skin);
  }
  return *best[again.index(kSkinVariant, best.size())];
}

}  // namespace

Outfit choose_outfit(uint64_t seed, const body::MacroShape& shape, const WardrobeLimits& limits) {
  require_known(limits);
  const CounterRandom random(seed, kWardrobeStream), again(seed, kLimitStream);
  const bool male = shape.gender >= 0.5f;
  Outfit outfit;
  outfit.garment = choose_garment(random, again, male, limits);
  outfit.shoes = &pick(shoes(), random, kShoes);
  const std::string age = shape.age_years < 42   ? "young"
                          : shape.age_years < 62 ? "middleage"
                                                 : "old";
  std::string ancestry = "caucasian";
  if (shape.african >= shape.asian && shape.african >= shape.caucasian) {
    ancestry = "african";
  } else if (shape.asian >= shape.caucasian) {
    ancestry = "asian";
  }
  const Skin skin =
      choose_skin(make_skin(age, ancestry, male, random.unit(kSkinVariant) < 0.5), again, limits);
  outfit.skin = skin.folder;
  outfit.skin_texture = skin.texture;

  // An afro belongs to dark skin; dark skin and black hair keep their texture's own black.
  std::vector<const Hair*> styles;
  for (const Hair& hair : hair_for(male)) {
    if (std::string(hair.name) != "afro01" || ancestry == "african") styles.push_back(&hair);
  }
  outfit.hair = styles[random.index(kHairStyle, styles.size())];
  outfit.hair_tint = pick(outfit.hair->tints, random, kHairTint);
  if (!limits.hair.empty()) {
    const auto found = std::find_if(hair_for(male).begin(), hair_for(male).end(),
                                    [&](const Hair& hair) { return limits.hair == hair.name; });
    if (found == hair_for(male).end())
      throw InputError("--hair: '" + limits.hair + "' is not in the wardrobe of this person");
    outfit.hair = &*found;
    outfit.hair_tint = found->tints[0];
  }

  static const std::array<const char*, 12> kBrowStyles = {
      "eyebrow001", "eyebrow002", "eyebrow003", "eyebrow004", "eyebrow005", "eyebrow006",
      "eyebrow007", "eyebrow008", "eyebrow009", "eyebrow010", "eyebrow011", "eyebrow012"};
  static const std::array<const char*, 3> kLashStyles = {"eyelashes02", "eyelashes03",
                                                         "eyelashes04"};
  static const std::array<const char*, 9> kIrises = {"brown", "brownlight", "brown",
                                                     "blue",  "bluegreen",  "deepblue",
                                                     "green", "grey",       "lightblue"};
  outfit.eyebrows = kBrowStyles[random.index(kBrows, kBrowStyles.size())];
  outfit.eyelashes = kLashStyles[random.index(kLashes, kLashStyles.size())];
  const size_t irises = ancestry == "caucasian" ? kIrises.size() : 3;
  outfit.eyes = std::string(kIrises[random.index(kEyes, irises)]) + "_eye.png";

  outfit.dye_turn_rad = static_cast<float>(random.uniform(kDyeTurn, -3.14159, 3.14159));
  outfit.dye_saturation = static_cast<float>(random.uniform(kDyeSaturation, 0.4, 0.75));
  outfit.dye_value = static_cast<float>(random.uniform(kDyeValue, 0.9, 1.3));
  choose_colours(CounterRandom(seed, kColourStream), shape, ancestry, outfit);
  return outfit;
}

}  // namespace figurine::capture
