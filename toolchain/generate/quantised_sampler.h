// A trained sampler as its package has it: directions and matrices in int8, every one of their rows
// with a scale of its own, and what all avatars of its population share.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/detail/fixed_point_weights.h"
#include "figurine/sampler.h"
#include "toolchain/generate/sampler_trainer.h"

namespace figurine::generate {

// Owns what `view` borrows, but for the golden pose and a network that all avatars share, which are
// the population's.
class QuantisedSampler {
 public:
  // ranges: of the avatars' values (activation_ranges.h). Throws InputError if the sampler is of
  // another variant than `basis`: the others are too large for a device; or if its training members
  // do not share how their maps are standardised and their heads decoded.
  QuantisedSampler(const TrainedSampler& trained, std::vector<Quantisation> ranges,
                   const std::string& name);
  QuantisedSampler(const QuantisedSampler&) = delete;
  QuantisedSampler& operator=(const QuantisedSampler&) = delete;

  const Sampler& view() const { return sampler_; }
  Sampler& view() { return sampler_; }  // for what is known later: golden seeds, report

 private:
  void take_what_members_share(const Population& population);
  void take_network(const Population& population);
  void take_static_groups(const TrainedSampler& trained, const Population& population);
  void quantise_space(const TrainedSampler& trained);
  void quantise_transformer(const TrainedSampler& trained);

  Sampler sampler_;
  std::vector<float> mean_, direction_scale_, row_scale_, bias_, position_, norm_, pose_mean_,
      pose_covariance_;
  std::vector<int8_t> directions_, matrices_;
  FixedPointStorage fixed_point_;                 // of the network that all avatars share
  std::vector<std::vector<float>> static_scale_;  // [groups]
  std::vector<std::vector<uint32_t>> static_row_;
};

// Mean and covariance of all training members' poses together, from each member's own: the law of
// total covariance, every member alike. mean: [3P]; covariance: [3P,3P], symmetric to the bit.
void pooled_pose_statistics(const Population& population, std::vector<float>& mean,
                            std::vector<float>& covariance);

}  // namespace figurine::generate
