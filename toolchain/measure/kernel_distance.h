// Kernel distance of two sets of features (KID where they are Inception's): the unbiased estimate
// of the squared maximum mean discrepancy with the cubic kernel k(x,y) = (x.y / F + 1)^3. Unbiased,
// so sets of different sizes may be compared, and below 0 where they are alike.
//
// Letters: n, m items of the two sets, F features of an item.
//
//   1/(n (n-1)) sum_{i /= j} k(a_i,a_j) + 1/(m (m-1)) sum_{i /= j} k(b_i,b_j) - 2/(n m) sum_{i,j}
//   k(a_i,b_j)
//
// Based on: Gretton et al., A Kernel Two-Sample Test, 2012, equation 3; Binkowski et al.,
// Demystifying MMD GANs, 2018 (kernel, subsets). Published tables often print 1,000 times the
// value.
#pragma once

#include <cstddef>
#include <cstdint>

#include "toolchain/measure/bootstrap.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::measure {

// a: [n,F], b: [m,F]. Throws InputError below two items in a set, for different F, or for values
// that are not finite.
double kernel_distance(const RowMatrix& a, const RowMatrix& b);

struct KernelSubsets {
  size_t subsets = 100;
  size_t size = 1000;  // items of a subset, of either set
  uint64_t seed = 0;
};

struct KernelDistance {
  double mean = 0;
  double deviation = 0;  // standard deviation over the subsets
};
// Over random subsets without repetition, subset i from (seed, i) alone. Throws InputError also for
// no subset, or one larger than a set.
KernelDistance kernel_distance(const RowMatrix& a, const RowMatrix& b,
                               const KernelSubsets& subsets);

// The same of people who have V pictures each. Pictures of one person are no independent draws,
// least of all in features that are to know a person in any pose: their pairs within a set would
// make few people look far apart, in KID's estimate too. Here the kernel of two people is the mean
// over their V^2 pairs of pictures, and no person is compared with itself. V = 1: kernel_distance.
class KernelComparison {
 public:
  // samples: [S V, F], references: [R V, F], person by person. Throws InputError below two people
  // in a set, if the sizes do not fit, or for values that are not finite.
  KernelComparison(const RowMatrix& samples, const RowMatrix& references, size_t pictures);

  Items all() const { return all_items(size_t(samples_.rows()), size_t(references_.rows())); }
  // Of a list of people in which some may stand several times (a bootstrap's): no pair is one of a
  // person and its own copy. NaN if a set is one person's copies.
  double distance(const Items& items) const;

 private:
  RowMatrix between_, samples_, references_;  // [S,R], [S,S], [R,R]: kernels of people
};

}  // namespace figurine::measure
