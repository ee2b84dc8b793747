// Diversity by part: people put together score, members and averages do not.
#include "toolchain/generation/part_diversity.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "toolchain/random/counter.h"

namespace figurine::generation::part_diversity_test {
namespace {

using measure::RowMatrix;
using measure::Token;

constexpr Eigen::Index kMembers = 40, kSize = 24;

const std::vector<Token>& tokens() {
  using enum measure::BodyPart;
  static const std::vector<Token> all{{"layer.0", 0, 4, {}},
                                      {"shape", 4, 4, {}},
                                      {"static.0.head.0", 8, 4, kHead},
                                      {"static.0.upper_body.0", 12, 4, kUpperBody},
                                      {"static.0.upper_body.1", 16, 4, kUpperBody},
                                      {"static.1.head.0", 20, 4, kHead}};
  return all;
}

RowMatrix members() {
  RowMatrix rows(kMembers, kSize);
  for (Eigen::Index i = 0; i < rows.size(); ++i)
    rows.data()[i] = random::random_normal(1, 0, static_cast<uint64_t>(i));
  return rows;
}

TEST(PartDiversity, FindsThePartsOfALayout) {
  const std::vector<PartStretch> parts = parts_of(tokens());
  ASSERT_EQ(parts.size(), 3u);
  EXPECT_EQ(parts[0].name, "build");
  EXPECT_EQ(parts[1].name, "head");
  EXPECT_EQ(parts[1].tokens.size(), 2u) << "of both groups";
  EXPECT_EQ(parts[2].name, "upper_body");
  EXPECT_EQ(parts[2].tokens.size(), 2u) << "both pieces";
  EXPECT_TRUE(describe_parts({}, members(), members()).empty());
}

TEST(PartDiversity, PeoplePutTogetherScore) {
  const RowMatrix own = members();
  RowMatrix mixed = own;  // the upper body of the next one
  for (Eigen::Index n = 0; n < kMembers; ++n)
    mixed.row(n).segment(12, 8) = own.row((n + 1) % kMembers).segment(12, 8);
  const nlohmann::json report = describe_parts(parts_of(tokens()), mixed, own);
  EXPECT_GT(report.at("mixed_share").get<double>(), 0.8) << "but for those with a faint part";
  EXPECT_LT(report.at("mixed_share").get<double>(), 1.0);
  EXPECT_EQ(report.at("combinations"), report.at("mixed_share")) << "no two alike";
  for (const nlohmann::json& part : report.at("parts")) {
    EXPECT_EQ(part.at("copy_share"), 1) << part.at("part");
    EXPECT_EQ(part.at("members_met"), size_t{kMembers});
    EXPECT_NEAR(part.at("spread").get<double>(), 1, 1e-12);
  }
}

TEST(PartDiversity, MembersAndAveragesDoNot) {
  const RowMatrix own = members();
  EXPECT_EQ(describe_parts(parts_of(tokens()), own, own).at("mixed_share"), 0.0);
  RowMatrix averages(kMembers, kSize);
  for (Eigen::Index n = 0; n < kMembers; ++n) {
    averages.row(n).setZero();
    for (Eigen::Index k = 0; k < 8; ++k) averages.row(n) += own.row((n + 3 * k) % kMembers) / 8;
  }
  const nlohmann::json report = describe_parts(parts_of(tokens()), averages, own);
  EXPECT_EQ(report.at("mixed_share"), 0.0);
  for (const nlohmann::json& part : report.at("parts"))
    EXPECT_LT(part.at("spread").get<double>(), 0.6);
}

}  // namespace
}  // namespace figurine::generation::part_diversity_test
