// Which few training members a model vector is a mixture of: the nearest point to it in the hull of
// at most k members. Averages of training members are what weight-space generators often emit; a
// person of its own is far from every such mixture.
//
// Letters: N training members, D values of a member, k members of a blend.
//
// The k members are searched for twice, and the better find counts: the k nearest ones, and the k
// heaviest in the nearest point of the hull of all N. The latter is what finds an average of five
// where other members lie nearer than the five; since N - 1 <= D, members are as good as never
// mixtures of each other, and a true mixture has one set of weights. No search of all sets: what is
// told is an upper bound.
//
// Based on: Wolfe, Finding the Nearest Point in a Polytope, 1976 (exact, finitely many steps).
#pragma once

#include <cstddef>
#include <vector>

#include "toolchain/measure/weight_space.h"

namespace figurine::generation {

struct Blend {
  std::vector<size_t> members;   // of positive weight
  std::vector<double> weights;   // as many; sum 1
  double relative_residual = 0;  // |z - blend| / |z - training mean|: 0 is a blend, above 1 the
                                 // mean of all explains it better
};

// Blends of at most 1, 2, ..., k members, residuals never growing; and that of any number.
struct Blends {
  std::vector<Blend> of_few;  // [k]
  Blend of_any;
};

class BlendSearch {
 public:
  // training: [N,D], N >= 2; borrowed, must outlive the search. O(N^2 D).
  explicit BlendSearch(const measure::RowMatrix& training);

  // z: [D]; 1 <= most (FIG_CHECK), cut to N. O(N D), and up to O(N^4) for the hull of all members.
  Blends closest(const measure::RowVector& z, size_t most) const;

 private:
  Blend blend_of(const measure::RowVector& z, const Eigen::MatrixXd& gram,
                 const std::vector<size_t>& members) const;

  const measure::RowMatrix* training_;
  measure::RowVector mean_;     // [D]
  measure::RowMatrix centred_;  // [N,D]
  Eigen::MatrixXd gram_;        // [N,N] of the centred members
};

// Weights [n] (none negative, sum 1) that minimise w^T gram w: the point of least norm in the hull
// of n points whose scalar products are given. gram: [n,n] symmetric, positive semi-definite, n
// >= 1.
Eigen::VectorXd least_norm_weights(const Eigen::MatrixXd& gram);

}  // namespace figurine::generation
