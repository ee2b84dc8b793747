// The span by kind of weight: one kind is replaced, the other and the shape stay.
#include "toolchain/members/member_span.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/toolchain/members/small_members.h"

namespace figurine::members::member_span_test {
namespace {

using tests::SmallMembers;

struct Measured {
  explicit Measured(const tests::SmallMembersOptions& options)
      : people(options), set(*people.package, *people.body.package, {.threads = 2, .quiet = true}) {
    const MemberBases bases = make_bases(set);
    spectrum = describe_spectrum(set, bases);
    span = measure_span(set, bases, {1, 2});
  }
  SmallMembers people;
  MemberSet set;
  nlohmann::json spectrum, span;
};

std::vector<std::string> keys(const nlohmann::json& object) {
  std::vector<std::string> names;
  for (const auto& [name, value] : object.items()) names.push_back(name);
  return names;
}

void expect_same_pictures(const nlohmann::json& rows, const nlohmann::json& others,
                          double to_within_db = 0) {
  ASSERT_EQ(rows.size(), 3u);
  for (size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].at("rank"), others[i].at("rank"));
    EXPECT_NEAR(rows[i].at("span_db").get<double>(), others[i].at("span_db").get<double>(),
                to_within_db);
  }
}

TEST(SpanByKind, KernelsAreAllThereIsWhereMapsAndShapesAreAlike) {
  const Measured same({.own_maps = false, .own_shapes = false});
  EXPECT_EQ(keys(same.span.at("by_kind")), (std::vector<std::string>{"kernels", "map"}));
  // All tokens together include the map, which is rounded anew: 57 dB.
  expect_same_pictures(same.span.at("by_kind").at("kernels"), same.span.at("per_layer"), 0.01);
  for (const nlohmann::json& row : same.span.at("by_kind").at("map")) {
    // The same values, in scales of 127 levels where they had 126: a few pixels move by a level.
    if (row.at("span_db").is_number()) {
      std::printf("a map rounded anew: %.1f dB\n", row.at("span_db").get<double>());
      EXPECT_GT(row.at("span_db").get<double>(), 45);
    }
    EXPECT_TRUE(row.at("variance_kept").is_null()) << "there is none";
  }
  EXPECT_EQ(same.spectrum.at("by_kind").at("map").at("entries"), 0);
  EXPECT_NEAR(same.spectrum.at("by_kind").at("kernels").at("share_of_whole").get<double>(), 1,
              1e-12);
  EXPECT_EQ(same.spectrum.at("by_kind").at("kernels").at("directions"),
            same.spectrum.at("whole").at("directions"));
}

TEST(SpanByKind, OfOneNetworkOnlyTheMapIsReplacedAndTheShapeKept) {
  const Measured map({.own_networks = false, .own_shapes = false}), shapes({.own_networks = false});
  EXPECT_EQ(keys(map.span.at("by_kind")), std::vector<std::string>{"map"});
  EXPECT_EQ(keys(map.spectrum.at("by_kind")), std::vector<std::string>{"map"});
  expect_same_pictures(map.span.at("by_kind").at("map"), map.span.at("per_layer"));
  // Where two coefficients of shape differ as well, they are kept: what a first direction alone
  // loses of them in all tokens is not lost, and two directions hold them whole.
  const nlohmann::json &kept = shapes.span.at("by_kind").at("map"),
                       &all = shapes.span.at("per_layer");
  EXPECT_NE(kept[0].at("span_db"), all[0].at("span_db"));
  for (size_t i = 0; i < 3; ++i) {
    if (i > 0) {
      EXPECT_NEAR(kept[i].at("span_db").get<double>(), all[i].at("span_db").get<double>(), 1e-6);
    }
    EXPECT_NEAR(kept[i].at("variance_kept").get<double>(),
                map.span.at("by_kind").at("map")[i].at("variance_kept").get<double>(), 1e-9);
  }
  EXPECT_LT(shapes.spectrum.at("by_kind").at("map").at("share_of_whole").get<double>(), 1);
}

TEST(SpanByKind, BothKindsTogetherLoseWhatAllTokensLose) {
  const Measured both({.own_shapes = false});
  const nlohmann::json &kinds = both.span.at("by_kind"), &all = both.span.at("per_layer");
  for (size_t i = 0; i < 3; ++i) {
    const double least = std::min(kinds.at("kernels")[i].at("span_db").get<double>(),
                                  kinds.at("map")[i].at("span_db").get<double>());
    EXPECT_LT(all[i].at("span_db").get<double>(), least + 0.5);
    // The whole's variance is that of its kinds.
    EXPECT_NEAR(both.spectrum.at("by_kind").at("kernels").at("share_of_whole").get<double>() +
                    both.spectrum.at("by_kind").at("map").at("share_of_whole").get<double>(),
                1, 1e-9);
  }
  EXPECT_GE(kinds.at("map")[2].at("variance_kept").get<double>(),
            kinds.at("map")[0].at("variance_kept").get<double>());
}

TEST(SpanByKind, WithoutMapsThereAreKernelsAlone) {
  const Measured old({.maps = false});
  EXPECT_EQ(keys(old.span.at("by_kind")), std::vector<std::string>{"kernels"});
  EXPECT_EQ(keys(old.spectrum.at("by_kind")), std::vector<std::string>{"kernels"});
}

}  // namespace
}  // namespace figurine::members::member_span_test
