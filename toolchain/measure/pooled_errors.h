// How different people look who are drawn alike: squared errors pooled over all pictures of a pair,
// for every pair of two sets.
//
// Letters: A, B items of two sets, P values of an item's pictures, V pictures of an item.
//
// An item is a stack of V pictures of fixed poses and views, RGB in [0,1] as stored over one
// background, as one row of P = V H W 3 values. Unlike the errors of union_error.h these have one
// denominator for all pairs, which nearest neighbours need: over the pixels of either foreground, a
// slim pair would count as farther apart than a stout one with the same errors.
#pragma once

#include "toolchain/measure/weight_space.h"

namespace figurine::measure {

using PictureRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Pooled mean squared errors of all pairs, one portion of the values after the other (all items'
// pictures of one view, say): memory is that of a portion. In double, of differences: equal items
// are 0 apart, and the error of a and b is that of b and a. A B P operations.
class PooledErrors {
 public:
  PooledErrors(size_t a, size_t b) : sums_(RowMatrix::Zero(Eigen::Index(a), Eigen::Index(b))) {}

  // a: [A,p], b: [B,p] the same p values of every item. Throws InputError if the shapes do not fit.
  void add(const PictureRows& a, const PictureRows& b);
  // Of a set with itself, in half the time. a: [A,p].
  void add(const PictureRows& a);

  RowMatrix mse() const;  // [A,B]; throws InputError before anything was added

 private:
  RowMatrix sums_;
  double values_ = 0;
};

RowMatrix pooled_mse(const PictureRows& a, const PictureRows& b);  // [A,P], [B,P] to [A,B]
RowMatrix pooled_mse(const PictureRows& a);                        // [A,P] to [A,A]

// -10 log10(mse), of a peak of 1: a similarity, infinite for equal pictures.
double psnr_db(double mse);

}  // namespace figurine::measure
