// What a denoiser sees of a population: unit scale, nothing lost where the variant promises it, and
// only the training part learnt from.
#include "toolchain/generate/model_space.h"

#include <gtest/gtest.h>

#include <cmath>

#include "toolchain/error.h"

namespace figurine::generate::model_space_test {
namespace {

using measure::RowMatrix;
using measure::RowVector;
using measure::Token;

// A repeatable matrix of normal numbers (sums of uniform ones).
RowMatrix normal_rows(Eigen::Index rows, Eigen::Index columns, uint64_t seed) {
  RowMatrix out(rows, columns);
  uint64_t state = seed;
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    double sum = -6;
    for (int k = 0; k < 12; ++k)
      sum +=
          static_cast<double>((state = state * 6364136223846793005u + 1442695040888963407u) >> 40) *
          0x1p-24;
    out.data()[i] = sum;
  }
  return out;
}

const std::vector<Token> kTokens{{"layer.0", 0, 30}, {"layer.1", 30, 15}, {"shape", 45, 3}};

// Tokens of very different scale about a mean, and a dead value.
RowMatrix members(Eigen::Index count, uint64_t seed) {
  RowMatrix w = normal_rows(count, 48, seed);
  w.leftCols(30) *= 1e-3;
  w.middleCols(30, 15) *= 20;
  w.array() += 0.25;
  w.col(7).setConstant(0.125);
  return w;
}

double mean_square(const RowMatrix& rows, size_t dimension) {
  return rows.squaredNorm() / static_cast<double>(rows.rows()) / static_cast<double>(dimension);
}

TEST(ModelSpace, EveryVariantHasUnitScaleAndGivesTrainingMembersBack) {
  const RowMatrix training = members(12, 1);
  for (const Variant variant : {Variant::kLayer, Variant::kFlat, Variant::kBasis}) {
    const ModelSpace space(training, kTokens, {.variant = variant, .rank = 64, .chunk = 10});
    const RowMatrix values = space.encode(training);
    ASSERT_EQ(static_cast<size_t>(values.cols()), space.size());
    EXPECT_NEAR(mean_square(values, space.dimension()), 1, 1e-9) << to_string(variant);
    for (Eigen::Index m = 0; m < training.rows(); ++m) {
      EXPECT_LT((space.decode(values.row(m)) - training.row(m)).cwiseAbs().maxCoeff(), 1e-10)
          << to_string(variant);
    }
    EXPECT_EQ(variant_from_string(to_string(variant)), variant);
  }
  EXPECT_THROW(variant_from_string("lattice"), InputError);
}

TEST(ModelSpace, CutsTokensAsTheVariantSays) {
  const RowMatrix training = members(12, 1);
  const ModelSpace layer(training, kTokens, {.variant = Variant::kLayer});
  EXPECT_EQ(layer.token_sizes(), (std::vector<size_t>{30, 15, 3}));
  EXPECT_EQ(layer.dimension(), 47u) << "the dead value does not count";
  const ModelSpace flat(training, kTokens, {.variant = Variant::kFlat, .chunk = 10});
  EXPECT_EQ(flat.token_sizes(), (std::vector<size_t>(5, 10)));
  EXPECT_EQ(flat.encode(training).rightCols(2).norm(), 0) << "padding";
  const ModelSpace basis(training, kTokens, {.variant = Variant::kBasis, .rank = 5});
  EXPECT_EQ(basis.token_sizes(), (std::vector<size_t>{5, 5, 3}));
  const ModelSpace whole(training, kTokens, {.variant = Variant::kBasis, .rank = 64});
  EXPECT_EQ(whole.token_sizes(), (std::vector<size_t>{11, 11, 3}))
      << "twelve members span eleven directions";
}

TEST(ModelSpace, BasisKeepsWhatItSpansOfOthers) {
  const RowMatrix training = members(12, 1);
  const ModelSpace space(training, kTokens, {.variant = Variant::kBasis, .rank = 64});
  const RowMatrix other = members(1, 99);
  const RowVector once = space.decode(space.encode(other).row(0));
  EXPECT_GT((once - other.row(0)).norm(), 1) << "a stranger lies outside the span";
  const RowMatrix projected = once;
  EXPECT_LT((space.decode(space.encode(projected).row(0)) - once).norm(), 1e-9)
      << "its projection lies inside";
  EXPECT_EQ(once[7], 0.125) << "a dead value stays what all members have";
}

TEST(ModelSpace, ATokenThatNothingVariesInStays) {
  RowMatrix training = members(6, 3);
  training.rightCols(3).setConstant(2);
  for (const Variant variant : {Variant::kLayer, Variant::kFlat, Variant::kBasis}) {
    const ModelSpace space(training, kTokens, {.variant = variant, .chunk = 16});
    const RowMatrix values = space.encode(training);
    EXPECT_TRUE(values.allFinite());
    const RowVector back = space.decode(RowVector::Constant(values.cols(), 3));
    EXPECT_TRUE(back.allFinite());
    EXPECT_EQ(back[46], 2) << to_string(variant);
  }
}

}  // namespace
}  // namespace figurine::generate::model_space_test
