// The wardrobe against the real data: everything named exists, fits and is held to its licence.
#include "toolchain/capture/wardrobe.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <set>

#include "gtest/gtest.h"
#include "toolchain/body/atlas.h"
#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/capture/cover.h"
#include "toolchain/capture/person.h"
#include "toolchain/capture/proxy.h"
#include "toolchain/error.h"

namespace figurine::capture::wardrobe_test {
namespace {

std::string directory() {
  const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
  return environment == nullptr ? "FIGURINE_MAKEHUMAN is not set: run this through scripts/run"
                                : environment;
}

const body::MakeHuman& makehuman() {
  static const body::MakeHuman data = body::MakeHuman::load(directory());
  return data;
}

TEST(Wardrobe, HoldsOnlyWhatHasACc0Counterpart) {
  const std::set<std::string> allowed = {"male_casualsuit01",
                                         "male_casualsuit02",
                                         "male_casualsuit03",
                                         "male_casualsuit04",
                                         "male_casualsuit05",
                                         "male_casualsuit06",
                                         "male_elegantsuit01",
                                         "male_worksuit01",
                                         "female_casualsuit01",
                                         "female_casualsuit02",
                                         "female_elegantsuit01",
                                         "female_sportsuit01",
                                         "afro01",
                                         "bob01",
                                         "bob02",
                                         "Braid01",
                                         "long01",
                                         "ponytail01",
                                         "short01",
                                         "short02",
                                         "short03",
                                         "short04"};
  for (bool male : {false, true}) {
    for (const Garment& garment : garments_for(male))
      EXPECT_EQ(allowed.count(garment.name), 1u) << garment.name;
    for (const Hair& hair : hair_for(male)) EXPECT_EQ(allowed.count(hair.name), 1u) << hair.name;
  }
}

// The emblem's orange and the shirt's blue are far apart: after covering, the region's strongest
// red must be that of the fabric.
TEST(Wardrobe, EmblemsAreCovered) {
  for (bool male : {false, true}) {
    for (const Garment& garment : garments_for(male)) {
      if (garment.cover.empty()) continue;
      ports::ImageU8 image = read_png(directory() + "/public/data/proxies/clothes/" + garment.name +
                                      "/textures/" + garment.name + "_diffuse.png");
      const auto spread = [&](const Region& region) {
        int low = 255, high = -255;
        for (uint32_t y = static_cast<uint32_t>(region.top * 512) + 8; y + 8 < region.bottom * 512;
             ++y) {
          for (uint32_t x = static_cast<uint32_t>(region.left * 512) + 8;
               x + 8 < region.right * 512; ++x) {
            const uint8_t* p = image.at(x, y);
            low = std::min(low, p[0] - p[2]);
            high = std::max(high, p[0] - p[2]);
          }
        }
        return high - low;
      };
      for (const ClonedRegion& clone : garment.cover) {
        EXPECT_GT(spread(clone.region), 90) << garment.name << ": no emblem here";
        clone_region(image, clone.region, clone.shift);
        EXPECT_LT(spread(clone.region), 60) << garment.name << ": something is left of it";
      }
    }
  }
}

TEST(Wardrobe, SameSeedSameOutfit) {
  const body::MacroShape shape = body::sample_macro_shape(7);
  const Outfit a = choose_outfit(3, shape), b = choose_outfit(3, shape);
  EXPECT_EQ(a.garment, b.garment);
  EXPECT_EQ(a.hair, b.hair);
  EXPECT_EQ(a.skin_texture, b.skin_texture);
  EXPECT_EQ(a.dye_turn_rad, b.dye_turn_rad);
  EXPECT_EQ(a.dye[0].x, b.dye[0].x);
}

std::string refusal(const WardrobeLimits& limits, const body::MacroShape& shape) {
  try {
    choose_outfit(3, shape, limits);
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(Wardrobe, ExcludedOutfitsAndSkinsAreNeverWorn) {
  const WardrobeLimits limits{
      .excluded_outfits = {"male_worksuit01", "female_sportsuit01"},
      .excluded_skins = {"young_darkskinned_male_diffuse", "old_lightskinned_female_diffuse2"}};
  int redressed = 0;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const body::MacroShape shape = body::sample_macro_shape(seed);
    const Outfit free = choose_outfit(seed, shape), limited = choose_outfit(seed, shape, limits);
    for (const std::string& name : limits.excluded_outfits) EXPECT_NE(limited.garment->name, name);
    for (const std::string& name : limits.excluded_skins)
      EXPECT_NE(limited.skin_texture, name + ".png");
    const bool concerned = std::string(free.garment->name).find("worksuit") != std::string::npos ||
                           std::string(free.garment->name).find("sportsuit") != std::string::npos;
    redressed += concerned;
    EXPECT_TRUE(concerned || free.garment == limited.garment)
        << "who is not concerned keeps their clothes";
    EXPECT_EQ(free.hair, limited.hair);
    EXPECT_EQ(free.dye[1].x, limited.dye[1].x);
  }
  EXPECT_GT(redressed, 20);
}

TEST(Wardrobe, OnlyListedOutfitsAndSkinsAreWorn) {
  const WardrobeLimits limits{
      .outfits = {"male_worksuit01", "female_sportsuit01"},
      .skins = {"young_darkskinned_male_diffuse", "old_lightskinned_female_diffuse2"}};
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const body::MacroShape shape = body::sample_macro_shape(seed);
    const Outfit outfit = choose_outfit(seed, shape, limits);
    const bool male = shape.gender >= 0.5f;
    EXPECT_STREQ(outfit.garment->name, male ? "male_worksuit01" : "female_sportsuit01");
    EXPECT_EQ(outfit.skin_texture,
              male ? "young_darkskinned_male_diffuse.png" : "old_lightskinned_female_diffuse2.png");
    EXPECT_EQ(outfit.skin, male ? "young_african_male" : "old_asian_female");
  }
}

TEST(Wardrobe, LimitsThatLeaveNothingAreNamed) {
  body::MacroShape man = body::sample_macro_shape(7);
  man.gender = 0.9f;
  EXPECT_NE(refusal({.outfits = {"male_suit99"}}, man).find("--outfit: 'male_suit99'"),
            std::string::npos);
  EXPECT_NE(refusal({.skins = {"green"}}, man).find("--skin: 'green'"), std::string::npos);
  EXPECT_NE(refusal({.excluded_outfits = {"green"}}, man).find("--exclude-outfits: 'green'"),
            std::string::npos);
  EXPECT_NE(refusal({.excluded_skins = {"green"}}, man).find("--exclude-skins: 'green'"),
            std::string::npos);
  EXPECT_NE(refusal({.hair = "bald"}, man).find("--hair: 'bald'"), std::string::npos);
  EXPECT_NE(refusal({.hair = "bob01"}, man).find("--hair: 'bob01'"), std::string::npos);
  EXPECT_NE(refusal({.outfits = {"female_sportsuit01"}}, man).find("--outfit"), std::string::npos);
  WardrobeLimits nothing;
  for (const Garment& garment : garments_for(true))
    nothing.excluded_outfits.push_back(garment.name);
  EXPECT_NE(refusal(nothing, man).find("--exclude-outfits: leaves nothing"), std::string::npos);
}

TEST(Wardrobe, EverySkinIsThere) {
  EXPECT_EQ(skins().size(), 20u);
  for (const Skin& skin : skins()) {
    EXPECT_EQ(
        read_png(directory() + "/public/data/skins/" + skin.folder + "/textures/" + skin.texture)
                .width_px %
            256,
        0u)
        << skin.texture;
  }
}

TEST(Proxy, EveryGarmentFitsAnyPerson) {
  for (uint64_t seed : {1u, 5u, 9u}) {
    body::MacroShape shape = body::sample_macro_shape(seed);
    for (bool male : {false, true}) {
      shape.gender = male ? 0.9f : 0.1f;
      const std::vector<float> vertices = makehuman().vertices(shape);
      for (const Garment& garment : garments_for(male)) {
        const Mesh mesh =
            fit_proxy(load_proxy(directory(), "clothes", garment.name), vertices, makehuman());
        ASSERT_GT(mesh.triangle_count(), 500u);
        float lowest = 10, highest = -10, widest = 0;
        for (size_t i = 0; i < mesh.position_m.size(); i += 3) {
          ASSERT_TRUE(std::isfinite(mesh.position_m[i]));
          widest = std::max(widest, std::fabs(mesh.position_m[i]));
          lowest = std::min(lowest, mesh.position_m[i + 1]);
          highest = std::max(highest, mesh.position_m[i + 1]);
        }
        EXPECT_GT(lowest, -0.05f) << garment.name;
        EXPECT_LT(highest, 2.0f) << garment.name;
        EXPECT_LT(widest, 1.0f) << garment.name;
        for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
          float sum = 0;
          for (uint32_t k = 0; k < kSkinInfluences; ++k)
            sum += mesh.skin_weights[size_t{v} * kSkinInfluences + k];
          ASSERT_NEAR(sum, 1, 1e-5);
        }
      }
    }
  }
}

TEST(Person, ShapeCoefficientsDescribeThePersonWithinAMillimetre) {
  const body::BodyModel model = body::make_makehuman_model(makehuman());
  const body::TexelBody texels = body::make_texel_body(model, 64);
  double worst = 0;
  for (uint64_t seed : {1u, 2u, 3u}) {
    const Person person =
        make_makehuman_person({.seed = seed}, makehuman(), directory(), texels.view());
    EXPECT_EQ(person.shape.size(), 20u);
    worst = std::max(worst, person.shape_error_m);
    // No skin under the shoes and the shirt, but a face and hands.
    const Mesh& skin = person.meshes.back();
    EXPECT_EQ(skin.name, "skin");
    EXPECT_GT(skin.triangle_count(), 5000u);
    EXPECT_LT(skin.triangle_count(), 2u * 13378u);
  }
  EXPECT_LT(worst, 0.001);
  std::printf("largest mean distance left by 20 coefficients: %.2f mm\n", 1e3 * worst);
}

// A body package's view in the layout that the mesh brings, or in one of other densities.
body::TexelBody texels_of(body::BodyModel model, uint32_t size, bool weighted) {
  if (weighted) {
    body::AtlasOptions atlas{.uv_size = size, .coarsest_grid = size / 2, .attempts = 50};
    atlas.weight[static_cast<size_t>(body::BodyPart::kHands)] = 2;
    model.surface = body::pack_atlas(model.surface, atlas);
  }
  body::TexelBody texels = body::make_texel_body(model, size);
  texels.states_mesh_places = weighted;
  return texels;
}

TEST(ShapeFit, FindsTheCoefficientsInAnyLayout) {
  const body::BodyModel model = body::make_mannequin();
  const std::vector<float> shape = {0.5f, -1.25f, 0.75f, 0.25f};
  body::Surface person = model.surface;
  person.position_m = body::shaped_vertices(model, shape);
  for (const bool weighted : {false, true}) {
    const body::TexelBody texels = texels_of(model, 64, weighted);
    const ShapeFit fit = fit_shape(texels.view(), person);
    ASSERT_EQ(fit.shape.size(), shape.size());
    for (size_t s = 0; s < shape.size(); ++s) EXPECT_NEAR(fit.shape[s], shape[s], 1e-4) << s;
    EXPECT_LT(fit.error_m, 1e-6);
  }
}

TEST(ShapeFit, RefusesTexelsOfAnotherMesh) {
  const body::BodyModel model = body::make_mannequin();
  for (const uint32_t shift : {1u << 30, 3000u}) {  // beyond the mesh, and on another limb
    body::TexelBody texels = texels_of(model, 32, true);
    for (uint32_t& triangle : texels.triangle)
      triangle =
          shift == 3000 ? (triangle + shift) % model.surface.triangle_count() : triangle + shift;
    try {
      fit_shape(texels.view(), model.surface);
      ADD_FAILURE() << "no error";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("--body: its texels are not those of this mesh"),
                std::string::npos);
    }
  }
}

// Coefficients differ, because every texel counts alike and the layouts have them elsewhere; the
// person hardly does.
TEST(ShapeFit, OfAMakeHumanPersonIsNearlyTheSameInAnyLayout) {
  const body::BodyModel model =
      body::make_makehuman_model(makehuman(), {.coefficients = 5, .samples = 30});
  std::vector<std::vector<float>> fitted;
  for (const bool weighted : {false, true}) {
    const body::TexelBody texels = texels_of(model, 64, weighted);
    fitted.push_back(body::shaped_vertices(
        model, make_makehuman_person({.seed = 1}, makehuman(), directory(), texels.view()).shape));
  }
  double apart_m = 0;
  for (size_t i = 0; i < fitted[0].size(); i += 3) {
    double square = 0;
    for (size_t k = i; k < i + 3; ++k)
      square += (double{fitted[0][k]} - fitted[1][k]) * (double{fitted[0][k]} - fitted[1][k]);
    apart_m += std::sqrt(square) / static_cast<double>(fitted[0].size() / 3);
  }
  std::printf("fits in two layouts: %.2f mm apart\n", 1e3 * apart_m);
  EXPECT_LT(apart_m, 0.002);  // five coefficients leave some millimetres of a person
}

TEST(Person, RefusesABodyOfOtherTexels) {
  const body::BodyModel model =
      body::make_makehuman_model(makehuman(), {.coefficients = 5, .samples = 30});
  body::TexelBody texels = body::make_texel_body(model, 32);
  texels.texel[3] += 1;
  try {
    make_makehuman_person({.seed = 1}, makehuman(), directory(), texels.view());
    ADD_FAILURE() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("--body"), std::string::npos);
  }
}

TEST(Cover, FindsWhatLiesUnderAGarment) {
  const auto square = [](float size, float z) {
    Mesh mesh;
    mesh.position_m = {-size, -size, z, size, -size, z, size, size, z, -size, size, z};
    mesh.triangles = mesh.uv_triangles = {0, 1, 2, 0, 2, 3};
    mesh.uv.assign(8, 0.0f);
    return mesh;
  };
  const auto covered = [&](float z) { return covered_vertices(square(0.5f, 0), square(1, z))[0]; };
  EXPECT_EQ(covered(0.03f), 1) << "a garment 3 cm above";
  EXPECT_EQ(covered(-0.01f), 1) << "poked through by 1 cm";
  EXPECT_EQ(covered(0.05f), 0) << "too far above";
  EXPECT_EQ(covered(-0.02f), 0) << "too far below";
}

}  // namespace
}  // namespace figurine::capture::wardrobe_test
