// The people themselves behind a population's members: made again by the recipe and photographed by
// the capture's renderer in the poses and by the cameras in which members are compared. What a
// trained avatar is to look like, free of what training lost.
//
// Light is the capture's, fixed in the world: a picture shows it from one heading, where an avatar
// has learnt the mean over all headings.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "toolchain/body/makehuman.h"
#include "toolchain/generation/people_distances.h"
#include "toolchain/members/member_set.h"
#include "toolchain/population/recipe.h"

namespace figurine::generation {

class CapturedPeople {
 public:
  // Finds the population's members in the recipe. makehuman: the unpacked npm package; not needed
  // for the mannequin. Throws InputError naming file, field and reason if the recipe is another
  // population's.
  CapturedPeople(const std::string& recipe, const std::string& makehuman,
                 const Population& population);

  const population::Recipe& recipe() const { return recipe_; }
  // Of `members` of the set, whose population must be the constructor's: kComparedShots pictures
  // each. About three seconds a person on one core. Throws InputError if a person has another shape
  // than the member, so comes of another seed; Interrupted.
  People draw(const members::MemberSet& set, std::span<const size_t> members) const;
  // So many people of the recipe's seed whom it does not name, numbered from kFirstUnseen, who may
  // wear what the recipe's first test people may: references that no avatar was trained for.
  // InputError where the recipe has no test people.
  static constexpr uint32_t kFirstUnseen = 900'000;
  People draw_unseen(const members::MemberSet& set, size_t count) const;

 private:
  std::vector<measure::Picture> photograph(const members::MemberSet& set,
                                           const population::Identity& identity,
                                           std::span<const float> shape) const;

  std::string path_, makehuman_directory_;
  population::Recipe recipe_;
  std::vector<population::Identity> identities_;  // [M], of the members
  std::optional<body::MakeHuman> makehuman_;
};

}  // namespace figurine::generation
