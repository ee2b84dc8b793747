// People put together of a population's training members by part, as further people to learn from:
// head, hands, shape and whatever else nobody exchanges of one; what another wears on the upper
// body; what a third wears on the lower. A hundred members make tens of thousands of them, all as
// sharp as members are, so that what a denoiser can learn by heart are parts, not people.
//
// Donors are of like skin and build (below), since sleeves and skirts leave skin to be seen and
// clothes are cut for a build. A part is its tokens, whole: nothing is blended at its border, where
// clothes have borders of their own, so that every token stays one that some member has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "figurine/body.h"
#include "figurine/population.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::generate {

// Who a mixed person is made of, by row among the training members.
struct MixedPerson {
  size_t base = 0, upper = 0, lower = 0;
};

class PeopleMixer {
 public:
  // Of every member there are this share of all that it takes clothes from, but two at least where
  // there are two others.
  static constexpr double kAlikeShare = 0.25;

  // training: [N,W] by the layout, which is the population's on this body. Throws InputError where
  // they cannot be mixed by part (part_mixture_obstacle).
  PeopleMixer(const measure::RowMatrix& training, const measure::WeightLayout& layout,
              const Population& population, const Body& body);

  size_t members() const { return alike_.size(); }  // N
  // The others whose clothes suit the member, nearest first. The distance of two members is
  //   |c_a - c_b| / median |c_i - c_j| + |s_a - s_b| / median |s_i - s_j|,
  // c the mean of the hands' static colours, s the shape coefficients; what members do not have, or
  // have in common, does not count.
  const std::vector<size_t>& alike(size_t member) const { return alike_[member]; }

  // One on the base of this member, a function of the three numbers: of three different members,
  // where there are three: who has two parts of one member is nearly that member, not a new person.
  MixedPerson draw(uint64_t seed, uint64_t counter, size_t base) const;
  // Whose token this is, by its place in the layout.
  size_t donor(const MixedPerson& person, size_t token) const;

 private:
  enum class From : uint8_t { kBase, kUpper, kLower };

  void find_alike(const measure::RowMatrix& colours, const measure::RowMatrix& shapes);

  std::vector<From> from_;  // [L]
  std::vector<std::vector<size_t>> alike_;
};

}  // namespace figurine::generate
