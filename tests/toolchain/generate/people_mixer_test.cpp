// People mixed by part: whose cells are whose, who may give clothes to whom, and that a linear
// space sees the same person in three pieces as in one.
#include "toolchain/generate/people_mixer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "tests/toolchain/members/small_members.h"
#include "toolchain/error.h"

namespace figurine::generate::people_mixer_test {
namespace {

using measure::RowMatrix;
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
  const Mixed mixed({.own_networks = true});
  const MixedPerson person{.base = 0, .upper = 3, .lower = 4};
  std::map<std::string, size_t> donors;
  for (size_t l = 0; l < mixed.layout.tokens().size(); ++l) {
    const std::string& name = mixed.layout.tokens()[l].name;
    const size_t donor = mixed.mixer.donor(person, l);
    donors[name] = donor;
    EXPECT_EQ(donor, name.find(".upper_body.") != std::string::npos   ? 3u
                     : name.find(".lower_body.") != std::string::npos ? 4u
                                                                      : 0u)
        << name;
  }
  for (const char* some :
       {"layer.0", "shape", "static.0.head.0", "static.0.upper_body.0", "static.0.lower_body.0"})
    EXPECT_TRUE(donors.contains(some)) << some;
}

TEST(PeopleMixer, LikesThoseOfLikeSkinAndBuild) {
  // Maps alike: shapes alone tell people apart, and those come one after the other.
  const Mixed mixed({.own_networks = false, .own_maps = false});
  EXPECT_EQ(mixed.mixer.alike(0), (std::vector<size_t>{1, 2}));
  EXPECT_EQ(mixed.mixer.alike(4), (std::vector<size_t>{3, 2}));
  // Maps of their own, shapes alike: whose hands are coloured alike.
  const Mixed coloured({.own_networks = false, .own_shapes = false});
  for (size_t m = 0; m < coloured.mixer.members(); ++m) {
    ASSERT_EQ(coloured.mixer.alike(m).size(), 2u) << "a quarter of five, but a choice";
    for (const size_t other : coloured.mixer.alike(m)) EXPECT_NE(other, m);
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
    EXPECT_EQ((std::set{a.base, a.upper, a.lower}).size(), 3u) << "three different members";
    met.emplace(a.upper, a.lower);
  }
  EXPECT_EQ(met.size(), 2u) << "either way round";
}

TEST(PeopleMixer, TwoMembersExchangeWhatTheyHave) {
  const SmallMembers people({.own_networks = false});
  const Population& population = people.package->population();
  const measure::WeightLayout layout(population, people.body.body());
  const PeopleMixer mixer(layout.read(population).topRows(2), layout, population,
                          people.body.body());
  const MixedPerson person = mixer.draw(7, 0, 1);
  EXPECT_EQ(person.base, 1u);
  EXPECT_EQ(person.upper, 0u);
  EXPECT_EQ(person.lower, 0u);
}

TEST(PeopleMixer, RefusesPeopleWithoutMapsOrParts) {
  EXPECT_THROW(Mixed({.maps = false}), InputError);
  EXPECT_THROW(Mixed({.joint_names = {}}), InputError);
}

}  // namespace
}  // namespace figurine::generate::people_mixer_test
