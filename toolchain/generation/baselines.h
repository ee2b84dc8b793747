// Rows that a generator of weights has to beat, made without any training: what a Gaussian,
// averages, noise and copies of the training members are worth in the same table. All in the space
// of model vectors, whatever the variant.
//
// Letters: N training members, D values of a model vector.
//
// Row i of a draw depends on (seed, first + i) alone. Values that all members share (dead channels,
// padding) keep their value.
#pragma once

#include <cstddef>
#include <cstdint>

#include "toolchain/measure/weight_space.h"

namespace figurine::generation {

struct Draw {
  size_t count = 0;
  uint64_t seed = 0;
  size_t first = 0;  // to draw in portions
};

// In all: training [N,D], N >= 1; gives [count,D]; throws InputError without members or values.

// A Gaussian of independent values, with the members' means and variances (divided by N: maximum
// likelihood). In the coordinates of a principal basis this is the Gaussian with that token's whole
// covariance, tokens apart.
measure::RowMatrix draw_independent_gaussian(const measure::RowMatrix& training, const Draw& draw);

// The Gaussian with the members' whole covariance (divided by N): mean + sum over n of c_n (z_n -
// mean) / sqrt(N), c_n normal. D may be as large as it likes; all samples lie in the members' span.
measure::RowMatrix draw_gaussian(const measure::RowMatrix& training, const Draw& draw);

// Means of m different members, every set as likely as any other. Throws InputError if there are
// fewer than m, or m is 0.
measure::RowMatrix draw_averages(const measure::RowMatrix& training, size_t m, const Draw& draw);

// Members, drawn with repetition, plus normal noise of standard deviation noise_rms in every value
// that varies.
measure::RowMatrix draw_noised_members(const measure::RowMatrix& training, double noise_rms,
                                       const Draw& draw);

// Members, drawn with repetition: the perfect memoriser.
measure::RowMatrix draw_members(const measure::RowMatrix& training, const Draw& draw);

}  // namespace figurine::generation
