// The shapes that a sampler's arrays follow from, by hand.
#include "figurine/sampler.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>

namespace figurine::sampler_test {
namespace {

TEST(Sampler, MethodsHaveTheirNames) {
  EXPECT_STREQ(to_string(SolverMethod::kDdim), "ddim");
  EXPECT_STREQ(to_string(SolverMethod::kDpmSolverPlusPlus2M), "dpmpp2m");
}

TEST(SamplerTokens, AreConvolutionsWithTheirBiasesThenTheShape) {
  Sampler sampler;
  sampler.network = {
      .input_size = 8,
      .input_channels = 10,
      .layers = {{.op = LayerOp::kConv2d, .inputs = {0, 0}, .out_channels = 4, .kernel = 3},
                 {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},
                 {.op = LayerOp::kUpsample2, .inputs = {2, 0}},
                 {.op = LayerOp::kConcat, .inputs = {1, 3}},
                 {.op = LayerOp::kConv2d, .inputs = {4, 0}, .out_channels = 14, .kernel = 1}}};
  EXPECT_EQ(sampler_token_sizes(sampler), (std::vector<size_t>{4 * (9 * 10 + 1), 14 * (8 + 1)}));
  sampler.shape_count = 20;
  EXPECT_EQ(sampler_token_sizes(sampler), (std::vector<size_t>{364, 126, 20}));
}

TEST(SamplerTokens, CountEveryParameterOfAPoseUnetOnce) {
  Sampler sampler;
  sampler.network = make_pose_unet(64, kMapChannels + 8, 16, head_channels(1));
  const std::vector<size_t> sizes = sampler_token_sizes(sampler);
  EXPECT_EQ(sizes.size(), 15u);
  EXPECT_EQ(std::accumulate(sizes.begin(), sizes.end(), uint64_t{0}),
            count_parameters(sampler.network));
}

TEST(SamplerTokensDeathTest, NeedAValidNetwork) {
  EXPECT_DEATH(static_cast<void>(sampler_token_sizes({})), "the network's shapes");
}

TEST(DenoiserMatrices, AreInTheOrderOfTheSchema) {
  const uint32_t ranks[] = {5, 2};
  const std::vector<MatrixShape> matrices =
      denoiser_matrices({.d_model = 8, .blocks = 2, .heads = 2, .feed_forward = 12}, ranks);
  const uint32_t expected[][2] = {
      {8, 5},  {8, 2},                    // proj
      {8, 8},  {8, 8},                    // time_in, time_out
      {24, 8}, {8, 8}, {12, 8}, {8, 12},  // a block: qkv, attended, feed_in, feed_out
      {24, 8}, {8, 8}, {12, 8}, {8, 12},  // and another
      {5, 8},  {2, 8}};                   // unproj
  ASSERT_EQ(matrices.size(), std::size(expected));
  for (size_t i = 0; i < matrices.size(); ++i) {
    EXPECT_EQ(matrices[i].rows, expected[i][0]) << i;
    EXPECT_EQ(matrices[i].columns, expected[i][1]) << i;
  }
}

}  // namespace
}  // namespace figurine::sampler_test
