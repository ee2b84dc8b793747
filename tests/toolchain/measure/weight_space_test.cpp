// The linear algebra of a population's weights against populations whose answer is known in closed
// form: members that are a mean and a known mixture of known directions.
#include "toolchain/measure/weight_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "figurine/texel_grid.h"
#include "formats/writer/population_writer.h"
#include "runtime/test_packages.h"
#include "toolchain/measure/body_parts.h"

namespace figurine::measure::weight_space_test {
namespace {

using tests::make_test_avatar;
using tests::make_test_body;

// Orthonormal rows of length 8, all orthogonal to (1, ..., 1): Hadamard's.
RowMatrix hadamard_rows(size_t count) {
  RowMatrix rows(count, 8);
  for (size_t k = 0; k < count; ++k) {
    for (size_t d = 0; d < 8; ++d)
      rows(k, d) = (std::popcount((k + 1) & d) % 2 == 0 ? 1 : -1) / std::sqrt(8.0);
  }
  return rows;
}

// Eight members whose coordinates along three directions have mean 0 and are uncorrelated:
// variances 9, 4 and 1.
RowMatrix known_members() {
  const RowMatrix columns = hadamard_rows(3) * std::sqrt(8.0);
  const Eigen::Vector3d deviation(3, 2, 1);
  return columns.transpose() * deviation.asDiagonal() * hadamard_rows(3);
}

TEST(PrincipalBasis, KnowsTheSpectrumOfAKnownMixture) {
  const RowMatrix members = known_members();
  const PrincipalBasis basis(members, 0, 8);
  ASSERT_EQ(basis.rank(), 3u);
  EXPECT_NEAR(basis.variance()[0], 9, 1e-12);
  EXPECT_NEAR(basis.variance()[1], 4, 1e-12);
  EXPECT_NEAR(basis.variance()[2], 1, 1e-12);
  EXPECT_EQ(directions_for(basis.variance(), 0.5), 1u);
  EXPECT_EQ(directions_for(basis.variance(), 0.9), 2u);
  EXPECT_EQ(directions_for(basis.variance(), 0.99), 3u);
  EXPECT_NEAR(participation_ratio(basis.variance()), 14.0 * 14 / (81 + 16 + 1), 1e-12);
  const RowMatrix directions = basis.directions(3);
  EXPECT_LT((directions * directions.transpose() - RowMatrix::Identity(3, 3)).cwiseAbs().maxCoeff(),
            1e-12);
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(std::abs(directions.row(k).dot(hadamard_rows(3).row(k))), 1, 1e-12);
}

TEST(PrincipalBasis, ProjectsWhatItSpansOntoItself) {
  const RowMatrix members = known_members();
  const PrincipalBasis basis(members, 0, 8);
  const RowVector inside = 0.5 * hadamard_rows(3).row(0) - 7 * hadamard_rows(3).row(2);
  const Eigen::VectorXd coordinates = basis.coordinates(inside);
  EXPECT_LT((basis.combine(coordinates, 3) - inside).norm(), 1e-12);
  EXPECT_LT((basis.combine(coordinates, 99) - inside).norm(), 1e-12)
      << "a rank beyond the basis is all of it";
  EXPECT_NEAR((basis.combine(coordinates, 1) - 0.5 * hadamard_rows(3).row(0)).norm(), 0, 1e-12);
  EXPECT_EQ(basis.combine(coordinates, 0).norm(), 0);
}

TEST(PrincipalBasis, KeepsNothingOfWhatIsOrthogonal) {
  const RowMatrix members = known_members();
  const PrincipalBasis basis(members, 0, 8);
  const RowVector outside = hadamard_rows(5).row(4) * 4;
  EXPECT_LT(basis.coordinates(outside).norm(), 1e-12);
  EXPECT_LT(basis.combine(basis.coordinates(outside), 3).norm(), 1e-12);
}

TEST(PrincipalBasis, SeesItsOwnStretchAlone) {
  RowMatrix members = RowMatrix::Zero(4, 6);
  members.col(1) << 1, -1, 1, -1;
  members.col(4) << 5, 5, -5, -5;
  const PrincipalBasis front(members, 0, 3), back(members, 3, 3);
  ASSERT_EQ(front.rank(), 1u);
  EXPECT_NEAR(front.variance()[0], 1, 1e-13);
  EXPECT_NEAR(back.variance()[0], 25, 1e-13);
  RowVector z(6);
  z << 1, 2, 3, 4, 5, 6;
  RowVector wanted(3);
  wanted << 0, 2, 0;
  EXPECT_LT((front.combine(front.coordinates(z), 1) - wanted).norm(), 1e-13);
  wanted << 0, 5, 0;
  EXPECT_LT((back.combine(back.coordinates(z), 1) - wanted).norm(), 1e-13);
}

TEST(PrincipalBasis, OfEqualMembersIsEmpty) {
  const RowMatrix members = RowMatrix::Zero(3, 4);
  const PrincipalBasis basis(members, 0, 4);
  EXPECT_EQ(basis.rank(), 0u);
  EXPECT_EQ(basis.combine(basis.coordinates(RowVector::Ones(4)), 2).norm(), 0);
  EXPECT_EQ(participation_ratio(basis.variance()), 0);
  EXPECT_EQ(directions_for(basis.variance(), 0.9), 0u);
}

TEST(Standardisation, ScalesTokensAndLeavesSharedValuesOut) {
  RowMatrix members(2, 5);
  members << 1, 7, 0.1, 10, 3,  //
      3, 7, 0.1, 30, 3;
  const Standardisation standardisation(members, {{"a", 0, 3}, {"b", 3, 1}, {"c", 4, 1}});
  EXPECT_EQ(standardisation.varying(), 2u);
  EXPECT_EQ(standardisation.varying(0), 1u);
  EXPECT_DOUBLE_EQ(standardisation.scale(0), 1);
  EXPECT_DOUBLE_EQ(standardisation.scale(1), 10);
  EXPECT_EQ(standardisation.scale(2), 0);
  RowMatrix other(1, 5);
  other << 4, 8, 0.2, 15, 2;
  const RowMatrix z = standardisation.standardise(other);
  RowVector wanted(5);
  wanted << 2, 0, 0, -0.5, 0;
  EXPECT_LT((z.row(0) - wanted).norm(), 1e-15);
  wanted << 4, 7, 0.1, 15, 3;
  EXPECT_EQ(standardisation.restore(z.row(0)), wanted) << "shared values come back to the bit";
}

TEST(Standardisation, GivesEveryTokenAUnitOfVarianceAValue) {
  const RowMatrix members = known_members() * 7;
  const Standardisation standardisation(members, {{"a", 0, 3}, {"b", 3, 5}});
  const RowMatrix z = standardisation.standardise(members);
  EXPECT_NEAR(z.leftCols(3).squaredNorm() / (8 * double(standardisation.varying(0))), 1, 1e-12);
  EXPECT_NEAR(z.rightCols(5).squaredNorm() / (8 * double(standardisation.varying(1))), 1, 1e-12);
  for (int m = 0; m < 8; ++m)
    EXPECT_LT((standardisation.restore(z.row(m)) - members.row(m)).norm(), 1e-12);
}

TEST(WeightSpace, DistancesAreRootMeanSquares) {
  RowMatrix a(2, 4), b(1, 4);
  a << 1, 2, 3, 0, 0, 0, 0, 0;
  b << 1, 0, 3, 0;
  const RowMatrix distances = rms_distances(a, b, 4);
  EXPECT_NEAR(distances(0, 0), 1, 1e-15);
  EXPECT_NEAR(distances(1, 0), std::sqrt(10.0 / 4), 1e-15);
}

TEST(WeightSpace, TokensAreAnAvatarsConvolutionsAndItsShape) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar made = make_test_avatar(body);
  const Avatar& avatar = made.package->avatar();
  const WeightLayout layout(avatar.network, avatar.shape.size());
  const std::vector<Token>& tokens = layout.tokens();
  ASSERT_EQ(tokens.size(), 16u);
  EXPECT_EQ(tokens.front().name, "layer.0");
  EXPECT_EQ(tokens[14].name, "layer.14");
  EXPECT_EQ(tokens.back().name, "shape");
  EXPECT_EQ(tokens.back().begin, count_parameters(avatar.network));
  EXPECT_EQ(tokens.back().size, avatar.shape.size());
  std::vector<double> weights(tokens.back().begin + tokens.back().size);
  layout.read(avatar, weights);
  EXPECT_EQ(weights[0], avatar.network.layers[0].weights[0]);
  EXPECT_EQ(weights[avatar.network.layers[0].weights.size()], avatar.network.layers[0].bias[0]);
  EXPECT_EQ(weights.back(), avatar.shape.back());
  WeightStorage storage;
  const Avatar same = layout.with(avatar, weights, storage);
  for (size_t i = 0; i < avatar.network.layers.size(); ++i) {
    EXPECT_TRUE(
        std::ranges::equal(same.network.layers[i].weights, avatar.network.layers[i].weights));
    EXPECT_TRUE(std::ranges::equal(same.network.layers[i].bias, avatar.network.layers[i].bias));
  }
  EXPECT_TRUE(std::ranges::equal(same.shape, avatar.shape));
  EXPECT_EQ(WeightLayout(avatar.network, 0).tokens().size(), 15u);
}

// Two people of one network: their vectors are shape and map alone, cells patch by patch.
TEST(WeightSpace, OfOneNetworkAVectorIsShapeAndMapPatchByPatch) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar shared = make_test_avatar(body),
                               other = make_test_avatar(
                                   body, {.shape = {1, -2}, .seed = 1, .name = "other"});
  const uint32_t side = body.package->body().uv_size;
  const TexelGrid grid = make_texel_grid(body.package->body(), side);
  const size_t cells = grid.cell_count();
  std::vector<int8_t> mean(cells * 3), own(cells * 3);
  for (size_t i = 0; i < own.size(); ++i)
    mean[i] = static_cast<int8_t>(i % 11), own[i] = static_cast<int8_t>(int(i * 7) % 255 - 127);
  const std::vector<float> scale{0.01f, 0.02f, 0.03f};
  const auto with_map = [&](const tests::SyntheticAvatar& of, const std::vector<int8_t>& values) {
    Avatar avatar = of.package->avatar();
    avatar.network = shared.package->avatar().network;
    avatar.static_part.groups = {{kStaticColour, 3, side, values, scale}};
    return avatar;
  };
  const Avatar one = with_map(shared, mean), two = with_map(other, own);
  const Provenance provenance{.tool = "test"};
  NewPopulation made{.name = "two",
                     .initial = one.network,
                     .shared = &one,
                     .coding = DifferenceCoding::kNone,
                     .members = {{&one, &provenance}, {&two, &provenance}}};
  const tests::AlignedBytes bytes(*write_population(made));
  const Result<Package> package = Package::open(bytes.bytes(), "two");
  ASSERT_TRUE(package.ok()) << package.status().message();
  const WeightLayout layout(package->population(), body.package->body());
  ASSERT_EQ(layout.tokens().front().name, "shape");
  EXPECT_EQ(layout.network_size(), 2u);
  EXPECT_EQ(layout.size(), 2 + cells * 3);
  size_t next = 0;
  for (const Token& token : layout.tokens()) {
    EXPECT_EQ(token.begin, next);
    EXPECT_GT(token.size, 0u);
    next += token.size;
  }
  EXPECT_EQ(next, layout.size());
  const RowMatrix all = layout.read(package->population());
  EXPECT_EQ(all(1, 0), two.shape[0]);
  // Every value once: the same squares as the map itself has.
  double squares = 0;
  for (size_t i = 0; i < own.size(); ++i) squares += std::pow(double{scale[i % 3]} * own[i], 2);
  const auto map = all.row(1).tail(static_cast<Eigen::Index>(own.size()));
  EXPECT_NEAR(map.squaredNorm(), squares, 1e-9 * squares);
  // Of several pieces: the same values in the same order, in more tokens.
  const WeightLayout pieces(package->population(), body.package->body(), 12);
  EXPECT_GE(pieces.tokens().size(), 1u + 12);
  EXPECT_GT(pieces.tokens().size(), layout.tokens().size());
  EXPECT_EQ(pieces.patches()[0].row, layout.patches()[0].row);
  EXPECT_EQ(pieces.read(package->population()), all);
  // A patch has cells of one part, which its name says; all are there once, in the patches' order.
  const std::vector<BodyPart> of_texel = texel_parts(body.package->body());
  const WeightLayout::Patches& patches = layout.patches()[0];
  std::vector<uint32_t> sorted = patches.row;
  std::ranges::sort(sorted);
  for (uint32_t i = 0; i < cells; ++i) ASSERT_EQ(sorted[i], i);
  size_t cell = 0;
  for (size_t p = 0; p < patches.patch_rows.size(); ++p) {
    const Token& token = layout.tokens()[layout.map().first + p];
    EXPECT_EQ(token.size, size_t{patches.patch_rows[p]} * 3);
    for (uint32_t k = 0; k < patches.patch_rows[p]; ++k, ++cell) {
      const uint32_t row = patches.row[cell];
      EXPECT_TRUE(
          token.name.starts_with(std::string("static.0.") + to_string(of_texel[grid.source[row]])))
          << token.name;
      EXPECT_EQ(all(1, Eigen::Index(token.begin + 3 * k)), double{scale[0]} * own[3 * row]);
    }
  }
  // Back to an avatar: the network untouched, the map to within half a step of its largest value.
  WeightStorage storage;
  const std::vector<double> row(&all(1, 0), &all(1, 0) + layout.size());
  const Avatar back = layout.with(one, row, storage);
  EXPECT_TRUE(std::ranges::equal(back.network.layers[0].weights, one.network.layers[0].weights));
  EXPECT_TRUE(std::ranges::equal(back.shape, two.shape));
  const StaticGroup& group = back.static_part.groups[0];
  for (size_t i = 0; i < own.size(); ++i) {
    ASSERT_NEAR(group.scale[i % 3] * static_cast<float>(group.values[i]),
                scale[i % 3] * static_cast<float>(own[i]), 0.51f * scale[i % 3]);
  }
}

}  // namespace
}  // namespace figurine::measure::weight_space_test
