// People put together of a population's training members by part, as further people to learn from:
// head, hands, shape and whatever else nobody exchanges of one; what another wears on the upper
// body; what a third wears on the lower. A hundred members make a million of them, all as sharp as
// members are, so that what a denoiser can learn by heart are parts, not people.
//
// Donors are of like skin and build (below), since sleeves and skirts leave skin to be seen and
// clothes are cut for a build.
//
// Letters: N training members, W values of a member, D values of a model vector.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "figurine/body.h"
#include "figurine/population.h"
#include "toolchain/generate/model_space.h"
#include "toolchain/measure/part_exchange.h"

namespace figurine::generate {

// Who a mixed person is made of, by row among the training members.
struct MixedPerson {
  size_t base = 0, upper = 0, lower = 0;
};

class PeopleMixer {
 public:
  // Of every member there are this share of all, itself among them, that it takes clothes from.
  static constexpr double kAlikeShare = 0.25;
  // Mixed people that a space is found from, for every member that it is found from.
  static constexpr size_t kCorpusPeople = 2;

  // training: [N,W] by the layout, which is the population's on this body. Throws InputError where
  // they cannot be mixed by part (part_mixture_obstacle).
  PeopleMixer(const measure::RowMatrix& training, const measure::WeightLayout& layout,
              const Population& population, const Body& body);

  size_t members() const { return alike_.size(); }  // N
  // Those whose clothes suit the member, nearest first. The distance of two members is
  //   |c_a - c_b| / median |c_i - c_j| + |s_a - s_b| / median |s_i - s_j|,
  // c the mean of the hands' static colours, s the shape coefficients; what members do not have, or
  // have in common, does not count.
  const std::vector<size_t>& alike(size_t member) const { return alike_[member]; }

  // One on the base of this member, a function of the three numbers.
  MixedPerson draw(uint64_t seed, uint64_t counter, size_t base) const;
  // The values of a mixed person, with u and l the shares of a cell (PartExchange) of the upper and
  // the lower body:  (1 - u - l) base + u upper + l lower.  training: as given before. [W]
  measure::RowVector mix(const measure::RowMatrix& training, const MixedPerson& person) const;
  // The members and then mixed people on every one of them in turn: what a space is found from, so
  // that it holds their seams. [(1 + kCorpusPeople) N, W]
  measure::RowMatrix corpus(const measure::RowMatrix& training, uint64_t seed) const;

  // What base, upper and lower body of every member add to a model vector of a linear space:
  // encode(mix(person)) is the sum of three rows. [N,D] each.
  struct Parts {
    measure::RowMatrix base, upper, lower;
  };
  Parts parts(const measure::RowMatrix& training, const ModelSpace& space) const;

 private:
  void find_alike(const measure::RowMatrix& colours, const measure::RowMatrix& shapes);

  measure::RowVector upper_, lower_;  // [W] shares
  std::vector<std::vector<size_t>> alike_;
};

}  // namespace figurine::generate
