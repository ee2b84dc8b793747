// People put together of two by part: what is inside of a part is the other's, what is outside the
// own, and the seam between follows from canonical distances.
#include "toolchain/members/part_mixtures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "figurine/texel_grid.h"
#include "tests/toolchain/members/small_members.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members::part_mixtures_test {
namespace {

using measure::BodyPart;
using measure::PartExchange;
using tests::SmallMembers;
using train::OpenedMember;

constexpr std::array kParts{BodyPart::kHead, BodyPart::kUpperBody, BodyPart::kLowerBody};

double distance_m(const Body& body, uint32_t a, uint32_t b) {
  double squares = 0;
  for (size_t k = 0; k < 3; ++k)
    squares += std::pow(
        double(body.texel_position_m[3 * size_t{a} + k]) - body.texel_position_m[3 * size_t{b} + k],
        2);
  return std::sqrt(squares);
}

TEST(PartExchange, SharesFollowFromTheNearestTexelOfTheOtherSide) {
  const SmallMembers people({.own_networks = false});
  const Population& population = people.package->population();
  const Body& body = people.body.body();
  const PartExchange parts(population, body);
  const std::vector<BodyPart> of_texel = measure::texel_parts(body);
  size_t soft = 0;
  for (const BodyPart part : kParts) {
    EXPECT_EQ(parts.texels(part), size_t(std::ranges::count(of_texel, part)));
    EXPECT_GT(parts.texels(part), 0u);
    for (size_t g = 0; g < population.static_part.groups.size(); ++g) {
      const TexelGrid grid = make_texel_grid(body, population.static_part.groups[g].grid_size);
      ASSERT_EQ(parts.share(part, g).size(), grid.cell_count());
      for (size_t cell = 0; cell < grid.cell_count(); ++cell) {
        const uint32_t texel = grid.source[cell];
        const bool inside = of_texel[texel] == part;
        double nearest = 1e9;
        for (uint32_t other = 0; other < body.texel_count(); ++other) {
          if ((of_texel[other] == part) != inside)
            nearest = std::min(nearest, distance_m(body, texel, other));
        }
        const double seam_m = PartExchange::kSeamTexels * body.uv_size / grid.size *
                              body.texel_spacing_m[texel],
                     half = std::min(0.5, 0.5 * nearest / seam_m);
        EXPECT_NEAR(parts.share(part, g)[cell], inside ? 0.5 + half : 0.5 - half, 1e-6);
        soft += half < 0.5;
      }
    }
  }
  EXPECT_GT(soft, 0u) << "there is a seam";
}

TEST(PartRow, TakesThePartsCellsAndLeavesAllElse) {
  const SmallMembers people({.own_networks = true});
  const Population& population = people.package->population();
  const Body& body = people.body.body();
  const PartExchange parts(population, body);
  const measure::WeightLayout layout(population, body);
  const OpenedMember a(population, 1), b(population, 2);
  measure::WeightStorage storage;
  const Avatar mixed = part_row(layout, parts, a.avatar, b.avatar, PartRow::kHead, storage);
  EXPECT_TRUE(std::ranges::equal(mixed.shape, a.avatar.shape));
  for (size_t i = 0; i < mixed.network.layers.size(); ++i) {
    EXPECT_TRUE(
        std::ranges::equal(mixed.network.layers[i].weights, a.avatar.network.layers[i].weights));
  }
  size_t taken = 0, kept = 0;
  for (size_t g = 0; g < mixed.static_part.groups.size(); ++g) {
    const StaticGroup &own = a.avatar.static_part.groups[g],
                      &other = b.avatar.static_part.groups[g], &made = mixed.static_part.groups[g];
    const std::vector<double>& share = parts.share(BodyPart::kHead, g);
    for (size_t i = 0; i < made.values.size(); ++i) {
      const size_t cell = i / made.channels, c = i % made.channels;
      const double x = double{own.scale[c]} * own.values[i],
                   y = double{other.scale[c]} * other.values[i];
      ASSERT_NEAR(double{made.scale[c]} * made.values[i], x + share[cell] * (y - x),
                  0.51 * made.scale[c])
          << "to within half a step";
      taken += share[cell] == 1;
      kept += share[cell] == 0;
    }
  }
  EXPECT_GT(taken, 0u);
  EXPECT_GT(kept, 0u);
}

TEST(PartMixtures, AreToldForEveryPairAndPart) {
  const SmallMembers people({.own_networks = false});
  const MemberSet set(*people.package, *people.body.package, {.threads = 2, .quiet = true});
  const PartExchange parts(set.population(), people.body.body());
  const nlohmann::json report =
      measure_part_mixtures(set, parts, {{0, 1, "a test"}, {3, 2, "another"}});
  ASSERT_EQ(report.at("pairs").size(), 2u);
  const nlohmann::json& pair = report.at("pairs")[0];
  EXPECT_EQ(pair.at("a"), "person0");
  EXPECT_EQ(pair.at("why"), "a test");
  std::vector<std::string> names;
  for (const nlohmann::json& row : pair.at("rows")) names.push_back(row.at("of"));
  EXPECT_EQ(names, (std::vector<std::string>{"a", "b", "head", "upper_body", "lower_body"}));
  // The ends are the members themselves, and both together are twice their mean.
  EXPECT_EQ(pair.at("rows")[0].at("nearest").at("pictures").at("member"), "person0");
  EXPECT_TRUE(pair.at("rows")[0].at("nearest").at("pictures").at("psnr_db").is_null());
  EXPECT_EQ(pair.at("rows")[1].at("nearest").at("weights").at("member"), "person1");
  EXPECT_NEAR(pair.at("rows")[0].at("highpass_ratio").get<double>() +
                  pair.at("rows")[1].at("highpass_ratio").get<double>(),
              2, 1e-9);
  for (size_t row = 2; row < 5; ++row) {
    EXPECT_GT(pair.at("rows")[row].at("nearest").at("weights").at("rms").get<double>(), 0);
    EXPECT_TRUE(pair.at("rows")[row].at("nearest").at("pictures").at("psnr_db").is_number());
  }
}

TEST(PartMixtures, NeedMapsAndABodyWithParts) {
  const SmallMembers without({.maps = false}), cylinder({.joint_names = {}}),
      headless({.joint_names = {"pelvis", "spine1", "spine2", "spine3"}}), good({});
  const auto obstacle = [](const SmallMembers& people) {
    return measure::part_mixture_obstacle(people.package->population(), people.body.body());
  };
  EXPECT_NE(obstacle(without).find("have no static values"), std::string::npos);
  EXPECT_NE(obstacle(cylinder).find("joint called like head"), std::string::npos);
  EXPECT_NE(obstacle(headless).find("joint called like head"), std::string::npos);
  EXPECT_EQ(obstacle(good), "");
}

}  // namespace
}  // namespace figurine::members::part_mixtures_test
