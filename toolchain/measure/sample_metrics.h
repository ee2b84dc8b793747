// How well a set of samples stands for a set of references, from dissimilarities alone (pooled mse,
// a feature distance): do they come near (MMD), are all of them met (COV), can the two sets be told
// apart (1-NNA)?
//
// Letters: S samples, R references, as many of one as of the other.
//
//   MMD    minimum matching distance: mean over references of the distance to the nearest sample.
//          Blind to samples far from everything.
//   COV    coverage: share of references that are the nearest reference of at least one sample.
//          Blind to quality: samples far away count.
//   1-NNA  leave-one-out accuracy of a 1-nearest-neighbour classifier that tells samples from
//          references. 50 % is ideal; far *below* it, a
//          sample's nearest neighbour is a reference more often than chance has it: copies. So the
//              distance from 50 stands beside it.
//
// Ties do not depend on the order of the items: all references that are equally near are met; of k
// nearest neighbours, j of the item's own set, the item counts j / k. With references that a
// generator was trained on, copies win MMD and COV: novelty.h belongs beside them.
//
// Based on: Achlioptas et al., Learning Representations and Generative Models for 3D Point Clouds,
// 2018 (MMD, COV); Lopez-Paz and Oquab, Revisiting Classifier Two-Sample Tests, 2017 (1-NNA); Yang
// et al., PointFlow, 2019 (all three for generators, and why COV and MMD alone mislead).
#pragma once

#include <vector>

#include "toolchain/measure/bootstrap.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::measure {

// Dissimilarities: finite, smaller is nearer. Diagonals are not looked at.
struct SampleDistances {
  RowMatrix to_references;  // [S,R]
  RowMatrix samples;        // [S,S]
  RowMatrix references;     // [R,R]
};

// Every statistic is told of all items, or of a list of them in which items may stand several times
// (a bootstrap's): they are then as likely, but no item is its own copies' neighbour.
class SampleComparison {
 public:
  // Throws InputError if a set is empty, the sets are of unequal size, a matrix does not fit, or a
  // distance is not finite.
  explicit SampleComparison(SampleDistances distances);

  size_t size() const { return size_t(distances_.samples.rows()); }  // S = R
  Items all() const { return all_items(size(), size()); }

  double mmd(const Items& items) const;  // in the unit of the distances
  // Of mean squared errors: mean over references of the PSNR to the most similar sample, in dB.
  // Infinite as soon as one reference is met exactly.
  double mmd_psnr_db(const Items& items) const;
  double coverage_percent(const Items& items) const;
  double one_nna_percent(const Items& items) const;  // 50 is ideal

 private:
  SampleDistances distances_;
};

struct SampleMetrics {
  double mmd = 0;
  double coverage_percent = 0;
  double one_nna_percent = 0;
  double one_nna_off_ideal = 0;  // |1-NNA - 50|, in percentage points
};
SampleMetrics sample_metrics(const SampleComparison& comparison);  // of all items

// S >= R samples in disjoint draws of R each, in their order: [S / R]; what is left over is left
// out. Which seeds happen to be drawn moves COV by several points where references are few, and a
// mean over draws less so. It does not say more about the references. Throws InputError as
// SampleComparison does, or if there are fewer samples than references.
std::vector<SampleComparison> disjoint_draws(const SampleDistances& distances);

}  // namespace figurine::measure
