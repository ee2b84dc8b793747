// Frechet distance of two sets of features, each taken for a Gaussian: FID where the features are
// Inception's, and to be named after the network that they come from everywhere else.
//
// Letters: n items of a set, F features of an item.
//
//   d^2 = |mean_a - mean_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2))
//
// The estimate is biased upwards, the more the fewer items there are for their features (Chong and
// Forsyth 2020): compare sets of equal n alone, with F far below n. kernel_distance.h has no such
// bias.
//
// Based on: Frechet, Sur la distance de deux lois de probabilite, 1957; Dowson and Landau, The
// Frechet Distance between Multivariate Normal Distributions, 1982; Heusel et al., GANs Trained by
// a Two Time-Scale Update Rule, 2017 (for generators).
#pragma once

#include "toolchain/measure/weight_space.h"

namespace figurine::measure {

struct FeatureGaussian {
  RowVector mean;              // [F]
  Eigen::MatrixXd covariance;  // [F,F] symmetric, may be singular; divided by n - 1
};

// features: [n,F]. Throws InputError below two items, without features, or for values that are not
// finite.
FeatureGaussian fit_gaussian(const RowMatrix& features);

// d^2, not its root, as FID has it. Singular covariances are sound: eigenvalues within rounding of
// 0 are 0. Never negative. Throws InputError if the numbers of features differ. O(F^3).
double frechet_distance(const FeatureGaussian& a, const FeatureGaussian& b);
double frechet_distance(const RowMatrix& a, const RowMatrix& b);  // of features [n,F] and [m,F]

}  // namespace figurine::measure
