// The autoencoder of variant `latent`: its shapes, its loss against the formulas in double, and
// that it learns to give members back.
#include "toolchain/generate/autoencoder.h"

#include <gtest/gtest.h>

#include <cmath>

#include "toolchain/error.h"
#include "toolchain/generate/tensors.h"
#include "toolchain/model/threads.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generate::autoencoder_test {
namespace {

using measure::RowMatrix;

constexpr size_t kWidth = 300;  // a picture of 24 x 24, with 276 values of padding

RowMatrix random_rows(Eigen::Index rows, Eigen::Index columns, uint64_t seed) {
  RowMatrix out(rows, columns);
  for (Eigen::Index r = 0; r < rows; ++r)
    out.row(r) =
        to_rows(draw_noise(seed, 1, static_cast<uint64_t>(r), columns).unsqueeze(0)).row(0);
  return out;
}

SamplerSettings settings(double kl_weight = 1e-3) {
  SamplerSettings settings;
  settings.autoencoder.channels = 2, settings.autoencoder.kl_weight = kl_weight, settings.batch = 4;
  return settings;
}

TEST(Autoencoder, FoldsAMemberIntoAMapOfAnEighth) {
  const Autoencoder autoencoder(kWidth, settings().autoencoder, 1);
  EXPECT_EQ(autoencoder.latent_side(), 3);
  EXPECT_EQ(autoencoder.token_sizes(), (std::vector<size_t>{6, 6, 6}));
  const RowMatrix z = random_rows(70, kWidth, 2);  // more than are computed at once
  const RowMatrix latents = autoencoder.encode(z);
  ASSERT_EQ(latents.rows(), 70);
  ASSERT_EQ(latents.cols(), 18);
  const RowMatrix back = autoencoder.decode(latents);
  ASSERT_EQ(back.cols(), static_cast<Eigen::Index>(kWidth));
  // A member does not depend on those beside it, and a token is a row of the map with all of its
  // channels.
  EXPECT_LT((autoencoder.encode(z.bottomRows(1)) - latents.bottomRows(1)).norm(), 1e-5);
  EXPECT_LT((autoencoder.decode(latents.bottomRows(1)) - back.bottomRows(1)).norm(), 1e-4);
  const torch::Tensor map = autoencoder.posterior(to_tensor(z.topRows(1))).mean;
  for (const auto& [row, channel, column] :
       {std::array{0, 0, 0}, std::array{1, 1, 2}, std::array{2, 0, 1}}) {
    EXPECT_NEAR(latents(0, row * 6 + channel * 3 + column),
                map[0][channel][row][column].item<double>(), 1e-5);
  }
  EXPECT_LT((to_rows(autoencoder.reconstruct(map)) - back.topRows(1)).norm(), 1e-4)
      << "decode undoes encode's order";
}

TEST(Autoencoder, WholePicturesNeedNoPadding) {
  const Autoencoder autoencoder(16 * 16, settings().autoencoder, 1);
  EXPECT_EQ(autoencoder.latent_side(), 2);
  EXPECT_EQ(autoencoder.decode(autoencoder.encode(random_rows(2, 256, 3))).cols(), 256);
  EXPECT_EQ(Autoencoder(1, settings().autoencoder, 1).latent_side(), 1);
  AutoencoderSettings none;
  none.channels = 0;
  EXPECT_THROW(Autoencoder(kWidth, none, 1), InputError);
}

// The weight of the divergence alone differs between the two, and it draws the same noise.
TEST(Autoencoder, LossIsTheErrorAndTheDivergenceOfThePosterior) {
  const RowMatrix training = random_rows(4, kWidth, 4);
  auto autoencoder = std::make_shared<Autoencoder>(kWidth, settings().autoencoder, 5);
  const auto loss = [&](double kl_weight, Share share) {
    return Autoencoding(autoencoder, settings(kl_weight), training, RowMatrix(0, kWidth))
        .loss(0, share)
        .item<double>();
  };
  const Autoencoder::Posterior posterior = autoencoder->posterior(to_tensor(training));
  const RowMatrix mean = to_rows(posterior.mean.reshape({4, 18})),
                  log_variance = to_rows(posterior.log_variance.reshape({4, 18}));
  double divergence = 0;
  for (Eigen::Index i = 0; i < mean.size(); ++i) {
    const double m = mean.data()[i], v = std::exp(log_variance.data()[i]);
    divergence += 0.5 * (m * m + v - 1 - std::log(v)) / static_cast<double>(mean.size());
  }
  const double error = loss(0, {0, 4});
  EXPECT_NEAR(loss(1, {0, 4}) - error, divergence, 1e-5);
  EXPECT_GT(divergence, 1e-4);
  EXPECT_NEAR((loss(0, {0, 1}) + 3 * loss(0, {1, 3})) / 4, error, 1e-6) << "ranks share a batch";
}

TEST(Autoencoder, LearnsToGiveMembersBack) {
  model::use_threads(1);
  const RowMatrix members = random_rows(5, kWidth, 6);
  auto autoencoder = std::make_shared<Autoencoder>(kWidth, settings().autoencoder, 7);
  Autoencoding autoencoding(autoencoder, settings(1e-4), members, members);
  EXPECT_NEAR(autoencoding.validation_loss(), 1, 0.2)
      << "members of unit scale, and a network that knows nothing";
  ProcessGroup alone({}, 1);
  FlatTraining training{.title = "test",
                        .run = "test",
                        .checkpoint = testing::TempDir() + "autoencoder_test.safetensors",
                        .batch = 4};
  training.schedule = {.peak = 5e-3,
                       .ramp_iterations = 10,
                       .floor_fraction = 0.02,
                       .budget = {.iterations = 400, .seconds = 0}};
  training.quiet = true;
  FlatTrainer trainer(autoencoding, alone, training, [](const char*, const FlatProgress&) {});
  trainer.run();
  std::remove(training.checkpoint.c_str());
  const double error = autoencoding.validation_loss();
  std::printf("  mean square error %.3f\n", error);
  EXPECT_LT(error, 0.1);
  EXPECT_LT((autoencoder->decode(autoencoder->encode(members)) - members).squaredNorm() /
                static_cast<double>(members.size()),
            0.1);
}

}  // namespace
}  // namespace figurine::generate::autoencoder_test
