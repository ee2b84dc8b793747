// People mixed by part: whose cells are whose, who may give clothes to whom, and that a linear
// space sees the same person in three pieces as in one.
#include "toolchain/generate/people_mixer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/toolchain/members/small_members.h"
#include "toolchain/error.h"

namespace figurine::generate::people_mixer_test {
namespace {

using measure::BodyPart;
using measure::RowMatrix;
using measure::RowVector;
using tests::SmallMembers;

struct Mixed {
  SmallMembers people;
  measure::WeightLayout layout;
  RowMatrix training;
  PeopleMixer mixer;

  explicit Mixed(const tests::SmallMembersOptions& options)
      : people(options),
        layout(people.package->population(), people.body.body()),
        training(layout.read(people.package->population()).topRows(SmallMembers::kTraining)),
        mixer(training, layout, people.package->population(), people.body.body()) {}
};

TEST(PeopleMixer, TakesEveryPartFromItsDonor) {
  const Mixed mixed({.own_networks = false});
  const MixedPerson person{.base = 0, .upper = 3, .lower = 4};
  const RowVector values = mixed.mixer.mix(mixed.training, person);
  const measure::PartExchange parts(mixed.people.package->population(), mixed.people.body.body());
  const RowVector upper = parts.value_shares(BodyPart::kUpperBody, mixed.layout),
                  lower = parts.value_shares(BodyPart::kLowerBody, mixed.layout);
  EXPECT_LE((upper + lower).maxCoeff(), 1 + 1e-12);
  std::array<size_t, 3> count{};  // values that are mostly of the base, the upper, the lower body
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const auto own = [&](size_t member) { return mixed.training(Eigen::Index(member), i); };
    ASSERT_NEAR(values[i], own(0) + upper[i] * (own(3) - own(0)) + lower[i] * (own(4) - own(0)),
                1e-12);
    ++count[upper[i] > 0.5 ? 1 : lower[i] > 0.5 ? 2 : 0];
  }
  for (const size_t some : count) EXPECT_GT(some, 2u);
  EXPECT_EQ(values.head(2), mixed.training.row(0).head(2)) << "the shape is the base's";
  EXPECT_LT((mixed.mixer.mix(mixed.training, {2, 2, 2}) - mixed.training.row(2)).norm(), 1e-12)
      << "with oneself";
}

TEST(PeopleMixer, LikesThoseOfLikeSkinAndBuild) {
  // Maps alike: shapes alone tell people apart, and those come one after the other.
  const Mixed mixed({.own_networks = false, .own_maps = false});
  EXPECT_EQ(mixed.mixer.alike(0), (std::vector<size_t>{0, 1}));
  EXPECT_EQ(mixed.mixer.alike(4), (std::vector<size_t>{4, 3}));
  // Maps of their own, shapes alike: whose hands are coloured alike.
  const Mixed coloured({.own_networks = false, .own_shapes = false});
  for (size_t m = 0; m < coloured.mixer.members(); ++m) {
    ASSERT_EQ(coloured.mixer.alike(m).size(), 2u) << "a quarter of five, but a choice";
    EXPECT_EQ(coloured.mixer.alike(m)[0], m);
    EXPECT_NE(coloured.mixer.alike(m)[1], m);
  }
}

TEST(PeopleMixer, DrawsAreAFunctionOfTheirNumbers) {
  const Mixed mixed({.own_networks = false});
  std::set<std::pair<size_t, size_t>> met;
  for (uint64_t i = 0; i < 64; ++i) {
    const MixedPerson a = mixed.mixer.draw(7, i, 2), b = mixed.mixer.draw(7, i, 2);
    EXPECT_EQ(a.base, 2u);
    EXPECT_EQ(std::pair(a.upper, a.lower), std::pair(b.upper, b.lower));
    for (const size_t donor : {a.upper, a.lower})
      EXPECT_NE(std::ranges::find(mixed.mixer.alike(2), donor), mixed.mixer.alike(2).end());
    met.emplace(a.upper, a.lower);
  }
  EXPECT_EQ(met.size(), 4u) << "upper and lower body apart";
}

TEST(PeopleMixer, ThreePiecesOfAModelVectorAreThePerson) {
  const Mixed mixed({.own_networks = false});
  for (const Variant variant : {Variant::kLayer, Variant::kBasis}) {
    const RowMatrix corpus = mixed.mixer.corpus(mixed.training, 5);
    ASSERT_EQ(corpus.rows(), Eigen::Index(3 * SmallMembers::kTraining));
    EXPECT_EQ(corpus.topRows(mixed.training.rows()), mixed.training);
    const ModelSpace space(corpus, mixed.layout.tokens(), {.variant = variant, .rank = 64});
    const PeopleMixer::Parts parts = mixed.mixer.parts(mixed.training, space);
    const MixedPerson person{.base = 1, .upper = 2, .lower = 0};
    const RowMatrix whole = space.encode(mixed.mixer.mix(mixed.training, person));
    const RowVector sum = parts.base.row(1) + parts.upper.row(2) + parts.lower.row(0);
    EXPECT_LT((whole.row(0) - sum).norm(), 1e-9 * (1 + sum.norm())) << to_string(variant);
  }
}

TEST(PeopleMixer, RefusesPeopleWithoutMapsOrParts) {
  EXPECT_THROW(Mixed({.maps = false}), InputError);
  EXPECT_THROW(Mixed({.joint_names = {}}), InputError);
}

}  // namespace
}  // namespace figurine::generate::people_mixer_test
