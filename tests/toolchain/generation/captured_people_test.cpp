// Captures as references: a small population of mannequins is made by its recipe, then its people
// are photographed anew where its members are compared. Poses, cameras and people must be the same,
// which outlines show even of members that have hardly learnt. The build forks, so it comes before
// anything that starts a thread.
#include "toolchain/generation/captured_people.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "tests/toolchain/population/small_recipe.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/error.h"
#include "toolchain/generation/generation.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/population/build.h"
#include "toolchain/population/state.h"
#include "toolchain/train/opened_member.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/run_directory.h"

namespace figurine::generation::captured_people_test {

using measure::Picture;
using measure::union_error;
using members::kComparedShots;
using members::MemberSet;
using members::MemberSetOptions;
using train::OpenedMember;

namespace {

// The true recipe's people, two of them held out, in different parts.
nlohmann::json recipe_of_five() {
  nlohmann::json recipe = testing_tools::small_recipe();
  recipe["groups"] = nlohmann::json::parse(R"([{"split": "train", "first": 0, "count": 3},
    {"split": "validation", "first": 10, "count": 1},
    {"split": "test", "first": 20, "count": 1}])");
  recipe["initial_weights"]["rounds"] = 0;
  recipe["evaluation"] = nlohmann::json::object();
  return recipe;
}

class CapturedPeopleTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_.emplace();
    testing_tools::write_swinging_motion(folder_->path("swinging.fgn"));
    const population::State state{folder_->path("state")};
    population::build({.recipe = write(recipe_of_five()),
                       .state = state.folder,
                       .makehuman = {},
                       .slots = 2,
                       .quiet = true});
    population_.emplace(train::open_package(state.package(), PackageKind::kPopulation));
    body_.emplace(train::open_package(state.body(), PackageKind::kBody));
    set_.emplace(population_->package, body_->package,
                 MemberSetOptions{.threads = 2, .quiet = true});
  }
  static void TearDownTestSuite() {
    set_.reset(), body_.reset(), population_.reset(), folder_.reset();
  }

  static std::string write(const nlohmann::json& recipe) {
    train::write_json(folder_->path("recipe.json"), recipe);
    return folder_->path("recipe.json");
  }
  static CapturedPeople people(const nlohmann::json& recipe) {
    return {write(recipe), "", set_->population()};
  }
  static std::string refusal(const nlohmann::json& recipe) {
    try {
      people(recipe).draw(*set_, set_->held_out);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }

  static inline std::optional<testing_tools::TemporaryFolder> folder_;
  static inline std::optional<train::PackageFile> population_, body_;
  static inline std::optional<MemberSet> set_;
};

bool is_foreground(const Picture& picture, int x, int y) {
  return picture.rgba[4 * (size_t(y) * picture.width_px + size_t(x)) + 3] > 127;
}

// A person's body without clothes in a shot: the pixels that its texels fall into, skinned and
// projected here.
std::vector<std::array<int, 2>> project_body(const MemberSet& set, size_t member, size_t shot) {
  const Body& body = set.body->body();
  const OpenedMember opened(set.population(), member);
  std::vector<float> joints(size_t{body.joint_count()} * 3), texels(size_t{body.texel_count()} * 3);
  shape_body(body, opened.avatar.shape, joints, texels);
  std::vector<Affine> transforms(body.joint_count());
  skinning_transforms({body.parents, joints}, set.renderer.pose(shot), transforms);
  const Camera& camera = set.renderer.camera(shot);
  std::vector<std::array<int, 2>> pixels;
  for (size_t t = 0; t < body.texel_count(); ++t) {
    const Affine world_from_rest = blend(transforms, &body.texel_joints[t * kSkinInfluences],
                                         &body.texel_weights[t * kSkinInfluences]);
    const std::array<float, 3> world = transform_point(world_from_rest, &texels[3 * t]);
    const std::array<float, 3> view = transform_point({camera.view_from_world}, world.data());
    const int x = int(std::floor(camera.fx_px * view[0] / view[2] + camera.cx_px)),
              y = int(std::floor(camera.fy_px * view[1] / view[2] + camera.cy_px));
    if (x >= 0 && y >= 0 && x < int(camera.width_px) && y < int(camera.height_px))
      pixels.push_back({x, y});
  }
  return pixels;
}

// Shares: of the body that lies within a pixel of the capture's outline or inside, of the capture
// within three pixels of a texel.
double body_inside(const Picture& capture, const std::vector<std::array<int, 2>>& body) {
  size_t inside = 0;
  for (const auto& [x, y] : body) {
    bool near = false;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int u = std::clamp(x + dx, 0, int(capture.width_px) - 1),
                  v = std::clamp(y + dy, 0, int(capture.height_px) - 1);
        near = near || is_foreground(capture, u, v);
      }
    }
    inside += near ? 1 : 0;
  }
  return double(inside) / double(body.size());
}

double capture_explained(const Picture& capture, const std::vector<std::array<int, 2>>& body) {
  size_t seen = 0, explained = 0;
  for (int y = 0; y < int(capture.height_px); ++y) {
    for (int x = 0; x < int(capture.width_px); ++x) {
      if (!is_foreground(capture, x, y)) continue;
      ++seen;
      explained +=
          std::ranges::any_of(
              body,
              [&](const auto& at) { return std::abs(at[0] - x) <= 3 && std::abs(at[1] - y) <= 3; })
              ? 1
              : 0;
    }
  }
  return seen == 0 ? 0 : double(explained) / double(seen);
}

TEST_F(CapturedPeopleTest, StandWhereTheirBodiesStand) {
  const People captures = people(recipe_of_five()).draw(*set_, set_->held_out);
  double inside = 1, explained = 1, inside_others = 0;
  for (size_t i = 0; i < captures.size(); ++i) {
    ASSERT_EQ(captures[i].size(), kComparedShots);
    for (size_t shot = 0; shot < kComparedShots; ++shot) {
      const Picture& capture = captures[i][shot];
      ASSERT_EQ(capture.width_px, set_->picture_px);
      ASSERT_EQ(capture.rgba.size(), set_->pictures[i][shot].rgba.size());
      const auto body = project_body(*set_, set_->held_out[i], shot);
      inside = std::min(inside, body_inside(capture, body));
      explained = std::min(explained, capture_explained(capture, body));
      inside_others =
          std::max(inside_others, body_inside(captures[i][(shot + 1) % kComparedShots], body));
      for (size_t at = 0; at < capture.rgba.size(); at += 4) {
        for (size_t c = 0; c < 3; ++c)
          ASSERT_LE(capture.rgba[at + c], capture.rgba[at + 3] + 1) << "premultiplied";
      }
    }
  }
  std::printf(
      "of a body at least %.3f lies inside its capture (of another shot's at most %.3f), which it "
      "explains to %.3f\n",
      inside, inside_others, explained);
  EXPECT_GT(inside, 0.98);
  EXPECT_GT(explained, 0.95);
  EXPECT_LT(inside_others, 0.98);
}

TEST_F(CapturedPeopleTest, AreTheSameWhoeverElseIsDrawn) {
  const CapturedPeople true_people = people(recipe_of_five());
  const People all = true_people.draw(*set_, std::vector<size_t>{0, 1, 2, 3, 4}),
               some = true_people.draw(*set_, std::vector<size_t>{4, 1});
  for (size_t shot = 0; shot < kComparedShots; ++shot) {
    EXPECT_EQ(some[0][shot].rgba, all[4][shot].rgba);
    EXPECT_EQ(some[1][shot].rgba, all[1][shot].rgba);
    for (size_t other = 0; other < 4; ++other)
      EXPECT_LT(union_error(some[0][shot], all[other][shot]).psnr_db(), 30) << "somebody else";
  }
}

// Seven people in no part of the recipe, three at a time beside three training members; by hand.
TEST_F(CapturedPeopleTest, UnseenPeopleAreReferencesInGroupsOfOneSize) {
  const CapturedPeople true_people = people(recipe_of_five());
  GenerationOptions options{.replicates = 10};
  options.unseen = true_people.draw_unseen(*set_, 7);
  const People again = true_people.draw_unseen(*set_, 2);
  for (size_t i = 0; i < 2; ++i)
    EXPECT_EQ(options.unseen[i][0].rgba, again[i][0].rgba) << "the same whoever else is drawn";
  EXPECT_LT(union_error(options.unseen[0][0], options.unseen[1][0]).psnr_db(), 30);
  const nlohmann::json report =
      evaluate_generation(*set_, {{.name = "copies", .z = set_->training_z}}, options);
  EXPECT_EQ(report.at("references").at("unseen").at("people"), 7);
  const nlohmann::json& copies = report.at("rows")[0];
  double mmd_db[2]{};
  for (size_t i = 0; i < 6; ++i) {
    double best = 0;
    for (size_t n = 0; n < 3; ++n) {
      best = std::max(best,
                      union_error(set_->pictures[set_->training[n]], options.unseen[i]).psnr_db());
    }
    mmd_db[i / 3] += best / 3;
  }
  const nlohmann::json& unseen = copies.at("unseen_captures");
  EXPECT_NEAR(unseen.at("mmd_psnr_db").at("value").get<double>(), mmd_db[0], 1e-9);
  EXPECT_EQ(unseen.at("groups").at("count"), 2) << "the seventh is left over";
  EXPECT_NEAR(unseen.at("groups").at("mmd_psnr_db").get<double>(), (mmd_db[0] + mmd_db[1]) / 2,
              1e-9);
  // Copies are copies close up, too, and as sharp.
  ASSERT_TRUE(set_->has_busts());
  EXPECT_EQ(copies.at("bust").at("novelty").at("copy_share"), 1);
  EXPECT_NEAR(copies.at("bust").at("highpass_ratio").get<double>(), 1, 0.02);
  EXPECT_EQ(copies.at("novelty").at("pictures").at("nearest")[1], set_->name(set_->training[1]));
}

TEST_F(CapturedPeopleTest, EveryRowIsHeldAgainstThem) {
  GenerationOptions options{.replicates = 10};
  const std::vector<Generated> copies{{.name = "copies", .z = set_->training_z}};
  const nlohmann::json without = evaluate_generation(*set_, copies, options);
  EXPECT_EQ(without.dump().find("capture"), std::string::npos);
  options.captures = people(recipe_of_five()).draw(*set_, set_->held_out);
  nlohmann::json with = evaluate_generation(*set_, copies, options);
  double own_db = 0;
  for (size_t i = 0; i < 2; ++i)
    own_db += union_error(set_->pictures[set_->held_out[i]], options.captures[i]).psnr_db() / 2;
  EXPECT_DOUBLE_EQ(
      with.at("references").at("captures").at("render_to_capture_db").at("mean").get<double>(),
      own_db);
  EXPECT_EQ(with.at("references").at("captures").at("held_out"), 2);
  ASSERT_EQ(with.at("rows").size(), 3u);
  double mmd_db = 0;  // of the copies, by hand: the first two training members
  for (size_t i = 0; i < 2; ++i) {
    mmd_db +=
        std::max(union_error(set_->pictures[set_->training[0]], options.captures[i]).psnr_db(),
                 union_error(set_->pictures[set_->training[1]], options.captures[i]).psnr_db()) /
        2;
  }
  for (const nlohmann::json& row : with.at("rows")) {
    const nlohmann::json& captures = row.at("held_out_captures");
    EXPECT_EQ(captures.at("count"), 2);
    for (const char* key : {"coverage_percent", "one_nna_percent", "mmd_psnr_db"})
      EXPECT_TRUE(captures.at(key).at("value").is_number());
    EXPECT_TRUE(captures.at("one_nna_off_ideal").is_number());
    if (row.at("name") == "held-out members") continue;
    EXPECT_NEAR(captures.at("mmd_psnr_db").at("value").get<double>(), mmd_db, 1e-9);
  }
  // All else is as without.
  with.at("references").erase("captures");
  for (nlohmann::json& row : with.at("rows")) row.erase("held_out_captures");
  EXPECT_EQ(with, without);
}

TEST_F(CapturedPeopleTest, AnotherPopulationsRecipeIsRefused) {
  nlohmann::json recipe = recipe_of_five();
  recipe["name"] = "other";
  EXPECT_NE(refusal(recipe).find("recipe.json: name: 'other'"), std::string::npos)
      << refusal(recipe);
  recipe = recipe_of_five();
  recipe["groups"][2]["first"] = 21;
  EXPECT_NE(refusal(recipe).find("recipe.json: groups: no identity '000020'"), std::string::npos)
      << refusal(recipe);
  recipe = recipe_of_five();
  recipe["groups"][2]["split"] = "validation";
  EXPECT_NE(refusal(recipe).find("recipe.json: groups: identity '000020' is of part validation"),
            std::string::npos)
      << refusal(recipe);
  recipe = recipe_of_five();
  recipe["seed"] = 6;
  EXPECT_NE(refusal(recipe).find("recipe.json: seed: its identity '0000"), std::string::npos)
      << refusal(recipe);
  recipe = recipe_of_five();
  recipe.erase("body");
  EXPECT_NE(refusal(recipe).find("recipe.json: body: 'makehuman'"), std::string::npos)
      << refusal(recipe);
}

}  // namespace
}  // namespace figurine::generation::captured_people_test
