// Recipes: what is read, the split that follows from it, and what is refused with which words.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "tests/toolchain/population/small_recipe.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/error.h"
#include "toolchain/population/recipe.h"
#include "toolchain/train/run_directory.h"

namespace figurine::population::recipe_test {
namespace {

using testing_tools::small_recipe;
using testing_tools::small_shared_recipe;
using testing_tools::TemporaryFolder;

Recipe read(const nlohmann::json& json) {
  const TemporaryFolder folder;
  train::write_json(folder.path("recipe.json"), json);
  return read_recipe(folder.path("recipe.json"));
}

TEST(Recipe, SaysWhoIsMadeAndHow) {
  nlohmann::json json = small_recipe();
  json["training"]["views_per_pose"] = 2;
  json["training"]["precision"] = "f32";
  const Recipe recipe = read(json);
  EXPECT_TRUE(recipe.mannequin);
  EXPECT_EQ(recipe.training.preset, "nano");
  EXPECT_EQ(recipe.training.schedule.budget.iterations, 40u);
  EXPECT_EQ(recipe.training.views_per_pose, 2u);
  EXPECT_FALSE(recipe.training.bf16);
  EXPECT_EQ(recipe.cameras.width_px, 64u);
  EXPECT_EQ(recipe.cameras.bust_views, 0u) << "as before there were any";
  json["capture"]["bust_views"] = 3;
  EXPECT_EQ(read(json).cameras.bust_views, 3u);
  const std::vector<Identity> people = identities_of(recipe);
  ASSERT_EQ(people.size(), 4u);
  EXPECT_EQ(people[3].name(), "000010");
  EXPECT_EQ(people[3].split, Split::kTest);
}

TEST(Recipe, MayHaveOneNetworkForAllAndMapsForEach) {
  const Recipe recipe = read(small_shared_recipe());
  EXPECT_EQ(recipe.shared.identities, 2u);
  EXPECT_EQ(recipe.shared.iterations, 40u);
  EXPECT_EQ(recipe.shared.poses, 2u);
  EXPECT_EQ(recipe.initial.rounds, 0u);
  EXPECT_EQ(train::to_string(recipe.training.static_grids), "all:T");
  EXPECT_EQ(train::network_side(recipe.training), 16u);
  EXPECT_TRUE(read(small_recipe()).training.static_grids.empty()) << "off unless it is said";
  nlohmann::json json = small_shared_recipe();
  json["body"] = "makehuman";
  json["atlas"] = {{"hands", 5.5}, {"head", 2}};
  const Recipe weighted = read(json);
  ASSERT_TRUE(weighted.atlas_weight);
  EXPECT_EQ((*weighted.atlas_weight)[size_t(body::BodyPart::kHands)], 5.5);
  EXPECT_EQ((*weighted.atlas_weight)[size_t(body::BodyPart::kLegs)], 1);
}

TEST(Recipe, TheSplitNamesWhatOnlyTheTestPartWears) {
  nlohmann::json json = small_recipe();
  json["groups"] = {{{"split", "train"},
                     {"first", 0},
                     {"count", 2},
                     {"exclude_outfits", {"a", "b"}},
                     {"exclude_skins", {"s"}}},
                    {{"split", "validation"},
                     {"first", 5},
                     {"count", 1},
                     {"exclude_outfits", {"b", "c"}},
                     {"exclude_skins", {"s"}}},
                    {{"split", "test"}, {"first", 7}, {"count", 1}}};
  json["evaluation"] = nlohmann::json::object();
  const nlohmann::json split = split_of(read(json));
  EXPECT_EQ(split.at("train"), nlohmann::json({"000000", "000001"}));
  EXPECT_EQ(split.at("validation"), nlohmann::json({"000005"}));
  EXPECT_EQ(split.at("test"), nlohmann::json({"000007"}));
  EXPECT_EQ(split.at("only_test").at("outfits"),
            nlohmann::json({"b"}));  // the validation part may wear a
  EXPECT_EQ(split.at("only_test").at("skins"), nlohmann::json({"s"}));
}

TEST(Recipe, RefusesWhatItCannotMeanInOneLine) {
  const std::vector<std::pair<std::function<void(nlohmann::json&)>, std::string>> cases = {
      {[](auto& j) { j.erase("seed"); }, "recipe.json.seed: missing"},
      {[](auto& j) { j["sead"] = 1; }, "sead: unknown field"},
      {[](auto& j) { j["body"] = "smpl"; }, "body: 'smpl' is neither makehuman nor mannequin"},
      {[](auto& j) { j["preset"] = "huge"; }, "\"huge\" is none of nano, edge, fine, paper"},
      {[](auto& j) { j["motions"] = nlohmann::json::array(); }, "motions: is empty"},
      {[](auto& j) { j["motions"][0]["frames"] = -3; }, "motions[0].frames: not a whole number"},
      {[](auto& j) { j["motions"][0]["neutral"] = "second"; },
       "motions[0].neutral: 'second': neither first, zero, axes nor a frame's number"},
      {[](auto& j) { j["motions"][0]["neutral"] = -1; }, "motions[0].neutral: not a whole number"},
      {[](auto& j) { j["capture"]["size_px"] = 8; }, "capture.size_px: must lie in 16 to 8192"},
      {[](auto& j) { j["groups"][1]["first"] = 2; }, "groups: identity 2 is in two of them"},
      {[](auto& j) { j["groups"][0]["split"] = "dev"; }, "groups[0].split: 'dev' is none of"},
      {[](auto& j) { j["groups"][0]["split"] = "validation"; },
       "groups: none is of the part train"},
      {[](auto& j) { j["groups"][0]["count"] = 5000; }, "groups[0].count: must lie in 1 to"},
      {[](auto& j) { j["initial_weights"]["identities"] = 4; },
       "initial_weights.identities: 4 of 3 training identities"},
      {[](auto& j) { j["initial_weights"]["first_step"] = 1.5; },
       "initial_weights.first_step: out of range"},
      {[](auto& j) { j["training"]["iteration"] = 4; }, "training: iteration: unknown field"},
      {[](auto& j) { j["training"]["precision"] = "f16"; }, "training.precision: 'f16' is neither"},
      {[](auto& j) { j["package"] = {{"levels", 128}}; }, "levels: must lie in 1 to 127"},
      {[](auto& j) { j["evaluation"]["frozen"] = {77}; }, "frozen: identity 77 is in no group"},
      {[](auto& j) { j["shared_network"] = small_shared_recipe()["shared_network"]; },
       "shared_network: and initial_weights: one of the two"},
      {[](auto& j) { j["training"]["network_size"] = 16; },
       "training.network_size: needs static_grids"},
      {[](auto& j) { j["training"]["static_grids"] = "hair:T"; }, "\"hair\" are none of"},
      {[](auto& j) { j["atlas"] = {{"hands", 2}}; }, "atlas: is for the body makehuman"},
      {[](auto& j) { j["body"] = "makehuman", j["atlas"] = {{"ears", 2}}; },
       "'ears' is no part of the body"},
      {[](auto& j) {
         j = small_shared_recipe();
         j["training"].erase("static_grids"), j["training"].erase("network_size");
       },
       "shared_network: needs training.static_grids"},
      {[](auto& j) { j = small_shared_recipe(), j["shared_network"]["identities"] = 4; },
       "shared_network.identities: 4 of 3 training identities"},
      {[](auto& j) { j = small_shared_recipe(), j["shared_network"]["rounds"] = 4; },
       "shared_network: rounds: unknown field"},
  };
  for (const auto& [damage, words] : cases) {
    nlohmann::json json = small_recipe();
    damage(json);
    try {
      read(json);
      ADD_FAILURE() << "read, and should say: " << words;
    } catch (const InputError& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find(words), std::string::npos) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    }
  }
}

}  // namespace
}  // namespace figurine::population::recipe_test
