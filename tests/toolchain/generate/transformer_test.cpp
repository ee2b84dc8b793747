// The transformer as the paper describes it, against counts and equations of its own.
#include "toolchain/generate/transformer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generate::transformer_test {
namespace {

const TransformerShape kSmall{
    .token_sizes = {5, 3, 2}, .d_model = 16, .blocks = 2, .heads = 4, .feed_forward = 24};

torch::Tensor random_rows(int64_t rows, int64_t columns, uint64_t seed) {
  return torch::randn({rows, columns}, at::make_generator<at::CPUGeneratorImpl>(seed));
}

TEST(Transformer, CountsItsParameters) {
  const int64_t d = 16, block = 4 * d * d + 4 * d + 2 * 24 * d + 24 + d + 4 * d;
  EXPECT_EQ(parameter_count(kSmall),
            uint64_t(10 * d + 3 * d + 4 * d + 2 * (d * d + d) + 2 * block + 2 * d + 10 * d + 10));
  EXPECT_EQ(Transformer(kSmall, 1).weights().numel(),
            static_cast<int64_t>(parameter_count(kSmall)));
}

// The paper's UNet has 598,011 parameters in 15 layers. Its transformer: 12 blocks of 512 and 2048,
// of which DESIGN counts 650 million, 94 % of them in the projections.
TEST(Transformer, HasThePapersSize) {
  std::vector<int64_t> tokens(15, 0);
  int64_t left = 598011;
  for (size_t l = 0; l < 15; ++l) tokens[l] = l + 1 < 15 ? 598011 / 15 : left, left -= tokens[l];
  const uint64_t count = parameter_count(
      {.token_sizes = tokens, .d_model = 512, .blocks = 12, .heads = 16, .feed_forward = 2048});
  EXPECT_NEAR(static_cast<double>(count), 650e6, 3e6);
  EXPECT_NEAR(2.0 * 512 * 598011 / static_cast<double>(count), 0.94, 0.005);
}

TEST(Transformer, StartsAtTheMeanAndIsRepeatable) {
  const torch::Tensor z = random_rows(4, 10, 1), lambda = torch::linspace(-6, 4, 4);
  EXPECT_EQ(Transformer(kSmall, 1).forward(z, lambda).abs().max().item<float>(), 0);
  EXPECT_TRUE(torch::equal(Transformer(kSmall, 5).weights(), Transformer(kSmall, 5).weights()));
  EXPECT_FALSE(torch::equal(Transformer(kSmall, 5).weights(), Transformer(kSmall, 6).weights()));
}

// Gradients by central differences, in random directions of all parameters at once.
TEST(Transformer, GradientsAreThoseOfItsForwardPass) {
  Transformer transformer(kSmall, 3);
  transformer.weights().add_(0.05 * torch::randn({transformer.weights().numel()},
                                                 at::make_generator<at::CPUGeneratorImpl>(9)));
  const torch::Tensor z = random_rows(3, 10, 1), clean = random_rows(3, 10, 2),
                      lambda = torch::tensor({-3.0, 0.5, 4.0});
  const auto loss = [&] { return torch::mse_loss(transformer.forward(z, lambda), clean); };
  transformer.gradients().zero_();
  loss().backward();
  const torch::Tensor gradient = transformer.gradients().clone(),
                      start = transformer.weights().clone();
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const torch::Tensor direction =
        torch::randn({start.numel()}, at::make_generator<at::CPUGeneratorImpl>(100 + seed));
    const double step = 2e-3;
    transformer.weights().copy_(start + step * direction);
    const double up = loss().item<double>();
    transformer.weights().copy_(start - step * direction);
    const double down = loss().item<double>();
    transformer.weights().copy_(start);
    const double expected = (gradient * direction).sum().item<double>(),
                 found = (up - down) / (2 * step);
    EXPECT_NEAR(found, expected, 2e-2 * std::abs(expected) + 2e-4);
  }
}

TEST(Transformer, RowsOfABatchDoNotSeeEachOther) {
  Transformer transformer(kSmall, 3);
  transformer.weights().add_(0.1);
  const torch::Tensor z = random_rows(5, 10, 1), lambda = torch::linspace(-5, 5, 5);
  const torch::Tensor all = transformer.forward(z, lambda);
  for (int64_t i = 0; i < 5; ++i) {
    const torch::Tensor alone = transformer.forward(z.narrow(0, i, 1), lambda.narrow(0, i, 1));
    EXPECT_LT((alone - all.narrow(0, i, 1)).abs().max().item<float>(), 1e-5);
  }
}

TEST(Transformer, TellsItsTokensAndTimesApart) {
  Transformer transformer(kSmall, 3);
  transformer.weights().add_(0.1 * torch::randn({transformer.weights().numel()},
                                                at::make_generator<at::CPUGeneratorImpl>(9)));
  const torch::Tensor z = random_rows(1, 10, 1);
  const torch::Tensor a = transformer.forward(z, torch::tensor({-2.0})),
                      b = transformer.forward(z, torch::tensor({-1.9}));
  EXPECT_GT((a - b).abs().max().item<float>(), 1e-4);
  torch::Tensor other = z.clone();
  other[0][9] += 1;  // of the last token
  EXPECT_GT((transformer.forward(other, torch::tensor({-2.0})) - a)
                .narrow(1, 0, 5)
                .abs()
                .max()
                .item<float>(),
            1e-5)
      << "attention joins them";
}

TEST(Transformer, Bfloat16IsNearFloat) {
  Transformer transformer(kSmall, 3);
  transformer.weights().add_(0.05 * torch::randn({transformer.weights().numel()},
                                                 at::make_generator<at::CPUGeneratorImpl>(9)));
  const torch::Tensor z = random_rows(4, 10, 1), lambda = torch::linspace(-6, 4, 4);
  const torch::Tensor exact = transformer.forward(z, lambda),
                      rounded = transformer.forward(z, lambda, true);
  EXPECT_GT((exact - rounded).abs().max().item<float>(), 0);
  EXPECT_LT((exact - rounded).norm().item<float>(), 0.03f * exact.norm().item<float>());
}

// With nothing in its last layer it says that nobody moves: x = y, which is off by t (eps - x).
TEST(Transformer, OfFlowMatchingSaysTheWayToTheNoise) {
  TransformerShape shape = kSmall;
  shape.prediction = Prediction::kVelocity;
  Transformer flow(shape, 3), clean(kSmall, 3);
  const torch::Tensor x = random_rows(4, 10, 1), noise = random_rows(4, 10, 2),
                      lambda = torch::tensor({-6.0, -1.0, 0.5, 4.6}, torch::kFloat64);
  const torch::Tensor ratio = lambda.exp().unsqueeze(1), sigma = 1 / torch::sqrt(1 + ratio * ratio),
                      alpha = ratio * sigma;
  const torch::Tensor t = sigma / (alpha + sigma), y = (1 - t) * x + t * noise;
  const torch::Tensor z = (alpha * x + sigma * noise).to(torch::kFloat32);
  EXPECT_LT((noise_share(lambda).unsqueeze(1) - t).abs().max().item<double>(), 1e-7);
  EXPECT_LT((flow.forward(z, lambda) - y).abs().max().item<double>(), 2e-6);
  const torch::Tensor added =
      0.05 * torch::randn({flow.weights().numel()}, at::make_generator<at::CPUGeneratorImpl>(9));
  flow.weights().add_(added), clean.weights().add_(added);
  // The same network sees y and says v.
  const torch::Tensor v = clean.forward(y.to(torch::kFloat32), lambda);
  EXPECT_GT(v.abs().max().item<float>(), 1e-3);
  EXPECT_LT((flow.forward(z, lambda) - (y - t * v)).abs().max().item<double>(), 5e-6);
}

// Left out and scaled up: the mean stays, and the same seed leaves out the same.
TEST(Transformer, DropoutKeepsTheMeanOfWhatBlocksAdd) {
  TransformerShape shape = kSmall;
  shape.blocks = 1;
  Transformer transformer(shape, 3);
  transformer.weights().add_(0.05 * torch::randn({transformer.weights().numel()},
                                                 at::make_generator<at::CPUGeneratorImpl>(9)));
  const torch::Tensor z = random_rows(1, 10, 1).expand({4000, 10}).contiguous(),
                      lambda = torch::zeros({4000}, torch::kFloat64);
  const torch::Tensor whole = transformer.forward(z, lambda).mean(0);
  const auto dropped = [&](uint64_t seed) {
    torch::manual_seed(seed);
    return transformer.forward(z, lambda, false, 0.05);
  };
  const torch::Tensor one = dropped(1);
  EXPECT_TRUE(torch::equal(one, dropped(1)));
  EXPECT_FALSE(torch::equal(one, dropped(2)));
  const torch::Tensor spread = one.std(0, false);
  EXPECT_GT(spread.min().item<float>(), 0);
  const float off = ((one.mean(0) - whole).abs() / spread).max().item<float>();
  std::printf("  off by %.3f deviations\n", double(off));
  EXPECT_LT(off, 0.15);
}

TEST(Transformer, RefusesShapesThatCannotBe) {
  const auto refused = [](auto bend) {
    TransformerShape shape = kSmall;
    bend(shape);
    EXPECT_THROW(check(shape), InputError);
  };
  refused([](TransformerShape& s) { s.token_sizes.clear(); });
  refused([](TransformerShape& s) { s.token_sizes[1] = 0; });
  refused([](TransformerShape& s) { s.d_model = 20; });
  refused([](TransformerShape& s) { s.blocks = 0; });
  EXPECT_EQ(to_json(shape_from_json(to_json(kSmall), "here")), to_json(kSmall));
  EXPECT_THROW(shape_from_json({{"d_model", 3}}, "here"), InputError);
  nlohmann::json json = to_json(kSmall);
  json["prediction"] = "noise";
  EXPECT_THROW(shape_from_json(json, "here"), InputError);
  json.erase("prediction");  // before there were two
  EXPECT_EQ(shape_from_json(json, "here").prediction, Prediction::kClean);
}

}  // namespace
}  // namespace figurine::generate::transformer_test
