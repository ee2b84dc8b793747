// The space that a population's members lie in: an avatar's weights as one vector, cut into tokens,
// standardised by the training part, and the principal directions of what that part does
// (docs/numerics.md, "Weight space"). Linear algebra alone, in double: no files, pictures, reports
// or LibTorch.
//
// Letters: M rows of any members, N rows of training members, D values of a member, L tokens, K
// directions of a basis.
//
// One token a convolution, as the paper has them: its kernel [out,k,k,in] (OHWI), then its bias
// [out]; one for the shape coefficients; one for every patch of a static group's grid, with all of
// its channels. A patch has cells of one part of the body alone (body_parts.h), so that whoever
// wears another's jacket has that one's tokens: the part's cells along a Z-order curve over the
// grid, in one piece or, for comparison, cut into several. The order of the values is the same
// however many there are. Standardised values are z =
// (w - mean) / scale with the mean of every value and one scale a token, its root mean square
// deviation over the values that vary. A value that all training members share (a dead channel's)
// has no deviation to be measured in: z leaves it out as 0, and what is restored from z gets the
// shared value.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/population.h"
#include "figurine/sampler.h"
#include "figurine/texel_grid.h"
#include "toolchain/measure/body_parts.h"

namespace figurine::measure {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowVector = Eigen::RowVectorXd;

// A stretch of a member's vector.
struct Token {
  std::string name;  // "layer.N" by the order of the convolutions, as a run's weights are called;
                     // "shape"; "static.G.PART.P": piece P of a part in group G
  size_t begin = 0, size = 0;
  std::optional<BodyPart> part;  // whose cells it has; none of kernels and shape, nor where only a
                                 // sampler's package is known
};

// Memory behind an avatar that was made of a vector.
struct WeightStorage {
  std::vector<float> floats;
  std::vector<int8_t> integers;
};

// Which of an avatar's values are its own, and where they lie in its vector: the convolutions',
// unless the network is everybody's; the shape coefficients; the static part, patch of cells by
// patch, because what is far apart on the body has little to do with each other.
class WeightLayout {
 public:
  // Avatars of this network without a static part. No coefficients: no token of the shape.
  WeightLayout(const Network& network, size_t shape_coefficients);
  // A population's members, on a body that they fit (check_avatar_fits_body). pieces: of a static
  // group's grid; a part of the body has one at least (1: just one).
  WeightLayout(const Population& population, const Body& body, size_t pieces = 1);
  // A sampler's avatars.
  explicit WeightLayout(const Sampler& sampler);

  const std::vector<Token>& tokens() const { return tokens_; }  // [L] one after the other, no gaps
  size_t size() const { return size_; }                         // D
  // Values of convolutions and shape, which come first.
  size_t network_size() const { return network_size_; }
  // Tokens [first, end) of a kind of weight; none of them: both alike. The shape's is of neither.
  struct TokenRange {
    size_t first = 0, end = 0;
    bool empty() const { return first == end; }
  };
  TokenRange kernels() const { return {0, kernel_tokens_}; }  // convolutions, with their biases
  TokenRange map() const { return {map_begin_, tokens_.size()}; }  // patches of the static part
  // Rows and cells of a static group's patches, as a sampler's package has them.
  struct Patches {
    std::vector<uint32_t> row, patch_rows;
  };
  const std::vector<Patches>& patches() const { return patches_; }  // [groups]

  // The avatar's values in the order of its tokens. weights: [D].
  void read(const Avatar& avatar, std::span<double> weights) const;
  // All members of the population, opened one after the other: [M,D]; or the given ones.
  RowMatrix read(const Population& population) const;
  RowMatrix read(const Population& population, std::span<const size_t> members) const;
  // The avatar with other values, rounded to float, and its static ones to integers with 127 levels
  // of either sign a channel, in the storage, which must outlive it; all else is the given
  // avatar's.
  Avatar with(const Avatar& avatar, std::span<const double> weights, WeightStorage& storage) const;

 private:
  struct PatchName {
    std::string name;  // in its group
    std::optional<BodyPart> part;
  };

  void add(const std::string& name, size_t size, std::optional<BodyPart> part = {});
  void add_network(const Network& network);
  void end_network();  // what is added from here on is the map's
  void add_group(size_t group, uint32_t channels, Patches patches,
                 const std::vector<PatchName>& names);
  static Patches cut_into_patches(const TexelGrid& grid, const Body& body, size_t pieces,
                                  std::vector<PatchName>& names);

  bool own_network_ = true;
  std::vector<Token> tokens_;
  size_t size_ = 0, network_size_ = 0, kernel_tokens_ = 0, map_begin_ = 0;
  std::vector<Patches> patches_;
  // [values of the static part, group after group as an avatar has them] where each lies.
  std::vector<size_t> place_;
};

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

  // [M,D] to [M,D]; in place if it is moved in, for a large population fills much of a memory.
  RowMatrix standardise(RowMatrix weights) const;
  RowVector restore(const RowVector& z) const;  // [D] to [D]

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
