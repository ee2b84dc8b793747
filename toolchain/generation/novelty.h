// Whether samples are people of their own, or copies and averages of training members: the audit
// that weight-space generators mostly fail.
//
// Letters: S samples (or held-out members: what new people look like in the same figures), N
// training members, D values of a member.
//
//   distance  of a sample to its nearest training member, beside those of training members to their
//             nearest *other* one; in weights
//             (rms_distances) or in pictures (pooled_mse)
//   copies    samples at most as far as the 5 % of training members that have the nearest
//             neighbours
//   blends    what a convex blend of few members leaves of a sample (convex_blend.h)
//
// Generators that pass need not be good: noise is novel. Held-out members are the row to resemble,
// baselines.h has the rows to beat.
//
// Based on: Zeng et al., Generative Modeling of Weights: Generalization or Memorization?, 2025
// (arXiv 2506.07998).
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "toolchain/generation/convex_blend.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::generation {

struct NearestMember {
  size_t member = 0;  // the first of those that are equally near
  double distance = 0;
};
// Of every row. Throws InputError if there is nobody, or a distance is not finite.
std::vector<NearestMember> nearest_members(const measure::RowMatrix& to_training);  // [S,N]
std::vector<NearestMember> nearest_other_members(
    const measure::RowMatrix& training);  // [N,N], N >= 2; the diagonal is not looked at

struct Novelty {
  std::vector<NearestMember> samples;   // [S]
  std::vector<NearestMember> training;  // [N]
  double median_ratio =
      0;  // median distance of the samples over that of the training members; 0: a memoriser
  double copy_distance = 0;  // 5th percentile of the training members' distances
  double copy_share = 0;     // of the samples, at most that far
  size_t members_met = 0;    // different members that are some sample's nearest
};
// to_training: [S,N], training: [N,N], of one kind of distance. Throws InputError as above, or if
// the matrices do not fit.
Novelty measure_novelty(const measure::RowMatrix& to_training, const measure::RowMatrix& training);

// A sample is explained where its relative residual is at most this: a blend has 99 % of what sets
// it apart from the training mean.
inline constexpr double kExplainedResidual = 0.1;
inline constexpr size_t kMostBlended = 5;

struct BlendShare {
  size_t members = 0;  // of a blend, at most; N: any number
  double median_residual = 0;
  double explained_share = 0;     // of the samples
  std::vector<double> residuals;  // [S] relative ones
};
// Calls piece(i) for i in [0, count), in any order, several at a time if it likes.
using RunPieces = std::function<void(size_t count, const std::function<void(size_t)>& piece)>;

// For blends of at most 1, 2, ..., `most` members, and of any number last. samples: [S,D];
// training: [N,D]. A sample is a piece for `run`, which the result does not depend on; without it
// they follow each other. Throws InputError without samples, below two members, if the sizes differ
// or a value is not finite.
std::vector<BlendShare> measure_blends(const measure::RowMatrix& samples,
                                       const measure::RowMatrix& training,
                                       size_t most = kMostBlended, const RunPieces& run = {});

}  // namespace figurine::generation
