// The rule by which shared initial weights move.
#include <gtest/gtest.h>

#include "toolchain/error.h"
#include "toolchain/population/initial_weights.h"

namespace figurine::population::initial_weights_test {
namespace {

train::TensorFile weights(std::vector<float> values, std::vector<int64_t> shape = {2}) {
  train::TensorFile file;
  file.tensors["layer.0.weight"] = {std::move(shape), std::move(values)};
  return file;
}

TEST(ReptileStep, MovesAPartOfTheWayToTheMean) {
  const train::TensorFile next =
      reptile_step(weights({1, 10}), {weights({2, 20}), weights({4, 40})}, 0.25);
  EXPECT_EQ(next.tensors.at("layer.0.weight").values, (std::vector<float>{1.5f, 15}));
}

TEST(ReptileStep, WholeIsTheMeanAndNeedsNoWeights) {
  const train::TensorFile next = reptile_step({}, {weights({2, 20}), weights({4, 40})}, 1);
  EXPECT_EQ(next.tensors.at("layer.0.weight").values, (std::vector<float>{3, 30}));
}

TEST(ReptileStep, StaysWhereAllFineTunedWeightsAre) {
  const train::TensorFile at = weights({0.1f, -7.3f});
  EXPECT_EQ(reptile_step(at, {at, at, at}, 0.37).tensors.at("layer.0.weight").values,
            at.tensors.at("layer.0.weight").values);
}

TEST(ReptileStep, RefusesWeightsOfAnotherShape) {
  EXPECT_THROW(reptile_step(weights({1, 2}), {weights({1, 2}, {1, 2})}, 0.5), InputError);
  EXPECT_THROW(reptile_step(weights({1, 2}), {weights({1, 2}), weights({1, 2, 3}, {3})}, 0.5),
               InputError);
  EXPECT_THROW(reptile_step({}, {weights({1, 2})}, 0.5), InputError);
}

TEST(ReptileStep, FallsLinearlyAfterAWholeFirstStep) {
  const InitialWeightsRecipe recipe{.rounds = 5, .first_step = 0.6, .last_step = 0.2};
  EXPECT_EQ(reptile_step_size(recipe, 0), 1);
  EXPECT_DOUBLE_EQ(reptile_step_size(recipe, 2), 0.4);
  EXPECT_DOUBLE_EQ(reptile_step_size(recipe, 4), 0.2);
}

}  // namespace
}  // namespace figurine::population::initial_weights_test
