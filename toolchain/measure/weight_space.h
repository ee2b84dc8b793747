// The space that a population's members lie in: an avatar's weights as one vector, cut into tokens,
// standardised by the training part, and the principal directions of what that part does
// (docs/numerics.md, "Weight space"). Linear algebra alone, in double: no files, pictures, reports
// or LibTorch.
//
// Letters: M rows of any members, N rows of training members, D values of a member, L tokens, K
// directions of a basis.
//
// One token a convolution, as the paper has them: its kernel [out,k,k,in] (OHWI), then its bias
// [out]; one more for the shape coefficients. Standardised values are z = (w - mean) / scale with
// the mean of every value and one scale a token, its root mean square deviation over the values
// that vary. A value that all training members share (a dead channel's) has no deviation to be
// measured in: z leaves it out as 0, and what is restored from z gets the shared value.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "figurine/population.h"

namespace figurine::measure {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowVector = Eigen::RowVectorXd;

// A stretch of a member's vector.
struct Token {
  std::string
      name;  // "layer.N" by the order of the convolutions, as a run's weights are called; "shape"
  size_t begin = 0, size = 0;
};

// The tokens of avatars with this network, one after the other without gaps. No coefficients: no
// token of the shape.
std::vector<Token> weight_tokens(const Network& network, size_t shape_coefficients);

// The avatar's values in the order of its tokens. weights: [D].
void read_weights(const Avatar& avatar, std::span<double> weights);
// All members of a population, opened one after the other: [M,D].
RowMatrix read_weights(const Population& population);
// The avatar with other values, rounded to float into storage [D], which must outlive it; all else
// is the given avatar's.
Avatar with_weights(const Avatar& avatar, std::span<const double> weights,
                    std::span<float> storage);

class Standardisation {
 public:
  // training: [N,D], N >= 2.
  Standardisation(const RowMatrix& training, std::vector<Token> tokens);

  const std::vector<Token>& tokens() const { return tokens_; }  // [L]
  const RowVector& mean() const { return mean_; }               // [D]
  double scale(size_t token) const {
    return scale_[token];
  }  // 0 where no value of the token varies
  size_t varying(size_t token) const { return varying_[token]; }
  size_t varying() const;  // of all tokens together

  RowMatrix standardise(const RowMatrix& weights) const;  // [M,D] to [M,D]
  RowVector restore(const RowVector& z) const;            // [D] to [D]

 private:
  std::vector<Token> tokens_;
  RowVector mean_;
  RowVector factor_;  // [D] 1 / scale of the value's token; 0 where it does not vary
  std::vector<double> scale_;
  std::vector<size_t> varying_;
};

// Principal directions of the training members' standardised values in one stretch [begin, begin +
// size) of the vector: of a token, or of everything. Found from the N x N Gram matrix, so D may be
// as large as it likes. A direction is a mixture of training members, and so is everything that is
// projected. At most N - 1 directions, because the mean is taken out.
class PrincipalBasis {
 public:
  // training: [N,D] standardised; borrowed, must outlive the basis.
  PrincipalBasis(const RowMatrix& training, size_t begin, size_t size);

  size_t rank() const {
    return static_cast<size_t>(variance_.size());
  }  // K; directions below 1e-10 of the largest variance are rounding
  const Eigen::VectorXd& variance() const {
    return variance_;
  }  // [K] descending: mean square of the members' coordinates
  size_t begin() const { return begin_; }
  size_t size() const { return size_; }

  RowMatrix directions(size_t rank) const;                // [rank,size] orthonormal rows
  Eigen::VectorXd coordinates(const RowVector& z) const;  // z: [D]; [K]
  RowVector combine(const Eigen::VectorXd& coordinates,
                    size_t rank) const;  // the first `rank` of them, at most K: [size]

 private:
  const RowMatrix* training_;
  size_t begin_, size_;
  Eigen::VectorXd variance_;  // [K]
  Eigen::MatrixXd mixture_;   // [N,K]: direction k = sum_n mixture(n,k) z_n
};

// How many directions a spectrum needs. variance: descending, not negative.
size_t directions_for(const Eigen::VectorXd& variance, double share);
// (sum v)^2 / sum v^2: K for K equal variances, 1 for a single one; 0 for none.
double participation_ratio(const Eigen::VectorXd& variance);

// Root mean square difference of the rows' values over `varying` of them: [A,D], [B,D] to [A,B].
RowMatrix rms_distances(const RowMatrix& a, const RowMatrix& b, size_t varying);

}  // namespace figurine::measure
