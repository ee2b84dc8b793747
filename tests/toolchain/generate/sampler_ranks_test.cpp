// Training by several ranks: the gradients of one, the same bits on all, one end for all.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "tests/toolchain/generate/ranks.h"
#include "tests/toolchain/generate/small_people.h"
#include "toolchain/generate/sampler_trainer.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::generate::sampler_ranks_test {
namespace {

namespace fs = std::filesystem;
using tests::Ranks;

class SamplerRanks : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("sampler_ranks_test_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    tests::write_people(path("people.fgn"));
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  SamplerRequest request(const std::string& run, uint64_t iterations) const {
    SamplerRequest request{.population = path("people.fgn"),
                           .run = path(run),
                           .settings = {},
                           .command = "test",
                           .quiet = true};
    request.settings.space = {.variant = Variant::kBasis, .rank = 8, .chunk = 128};
    request.settings.shape = {
        .token_sizes = {}, .d_model = 16, .blocks = 1, .heads = 2, .feed_forward = 32};
    request.settings.batch = 8, request.settings.schedule.peak = 3e-3,
    request.settings.schedule.ramp_iterations = 5;
    request.settings.schedule.budget = {.iterations = iterations, .seconds = 0};
    request.rank_timeout_s = 60;
    return request;
  }

  // Each rank asks for the same, but for a run of its own, which only rank 0 may write.
  static Ranks::Body training(const SamplerRequest& request) {
    return [request](const RankPlace& place) {
      SamplerRequest own = request;
      own.place = place;
      if (place.rank > 0) own.run += ".rank" + std::to_string(place.rank);
      const SamplerResult result = train_sampler(own);
      return std::to_string(result.iteration) + " " + std::to_string(result.weights_hash);
    };
  }

  std::vector<std::string> train(int ranks, const SamplerRequest& request) const {
    return Ranks(ranks, training(request)).wait_for_all();
  }

  std::vector<float> checkpoint(const std::string& run, const std::string& tensor) const {
    return train::read_tensor_file(path(run) + "/checkpoint.safetensors").tensors.at(tensor).values;
  }

  // Waits until the run has a checkpoint, so that it is in the middle of its training.
  void wait_for_checkpoint(const std::string& run) const {
    for (int i = 0; i < 3000 && !fs::exists(path(run) + "/run.json"); ++i) usleep(10000);
    while (nlohmann::json(train::read_json(path(run) + "/run.json")).value("iterations", 0) == 0)
      usleep(10000);
  }

  fs::path folder_;
};

struct Difference {
  double largest = 0, rms = 0, size = 0;  // size: root mean square of the first
};

Difference difference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  Difference out;
  for (size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(static_cast<double>(a[i]) - b[i]);
    out.largest = std::max(out.largest, d), out.rms += d * d,
    out.size += static_cast<double>(a[i]) * a[i];
  }
  out.rms = std::sqrt(out.rms / static_cast<double>(a.size())),
  out.size = std::sqrt(out.size / static_cast<double>(a.size()));
  return out;
}

// After one iteration AdamW's first moment is a tenth of the gradient. The ranks add the same
// products as one process, in another order: a sum of n = 8 rows x 128 values of a token differs by
// rounding alone, sqrt(n) 2^-24 = 2e-6 of the largest gradient at most.
TEST_F(SamplerRanks, GiveTheGradientsOfOneProcess) {
  train(1, request("one", 1));
  for (const int ranks : {2, 3}) {
    const std::string run = "ranks" + std::to_string(ranks);
    train(ranks, request(run, 1));
    const std::vector<float> whole = checkpoint("one", "first_moment");
    const Difference gradients = difference(whole, checkpoint(run, "first_moment"));
    double largest = 0;
    for (const float value : whole)
      largest = std::max(largest, static_cast<double>(std::abs(value)));
    std::printf("  %d ranks: gradients differ by %.2g of the largest at most\n", ranks,
                gradients.largest / largest);
    EXPECT_GT(largest, 0);
    EXPECT_LT(gradients.largest, 2e-6 * largest);
  }
}

// AdamW divides a gradient by its own size: where it is rounding alone, the step is as long as any
// other and may point elsewhere. So no single weight can be promised more than twice the sum of the
// learning rates; all of them together stay near, because few are like that.
TEST_F(SamplerRanks, EndWhereOneProcessEnds) {
  const std::vector<std::string> one = train(1, request("one", 30)),
                                 two = train(2, request("two", 30)),
                                 three = train(3, request("three", 30));
  EXPECT_EQ(two[1], two[0]) << "the ranks' own weights, to the bit";
  EXPECT_EQ(three[1], three[0]);
  EXPECT_EQ(three[2], three[0]);
  EXPECT_EQ(one[0].rfind("30 ", 0), 0u) << one[0];
  for (const char* run : {"two", "three"}) {
    const Difference weights = difference(checkpoint("one", "weights"), checkpoint(run, "weights"));
    std::printf("  %s: weights differ by %.2g at most, %.2g rms of %.2g\n", run, weights.largest,
                weights.rms, weights.size);
    EXPECT_LT(weights.largest, 2 * 30 * 3e-3);
    EXPECT_LT(weights.rms, 2e-5 * weights.size);
  }
  for (int rank = 1; rank < 3; ++rank) {
    EXPECT_FALSE(fs::exists(path("two.rank" + std::to_string(rank)))) << "rank 0 alone writes";
    EXPECT_FALSE(fs::exists(path("three.rank" + std::to_string(rank))));
  }
}

// The autoencoder of variant `latent` is trained by all ranks, too, and only rank 0 has its file.
TEST_F(SamplerRanks, TrainAnAutoencoderTogether) {
  SamplerRequest latent = request("latent", 10);
  latent.settings.space.variant = Variant::kLatent;
  latent.settings.autoencoder = {.channels = 2, .schedule = latent.settings.schedule};
  latent.stop_after = 5;  // in the autoencoder
  train(2, latent);
  latent.resume = true, latent.stop_after = 0;
  const std::vector<std::string> two = train(2, latent);
  EXPECT_EQ(two[0].rfind("10 ", 0), 0u) << two[0];
  EXPECT_EQ(two[1], two[0]);
}

TEST_F(SamplerRanks, GoOnWithTheSameBits) {
  const std::vector<std::string> whole = train(2, request("whole", 40));
  SamplerRequest cut = request("cut", 40);
  for (const uint64_t stop : {7u, 31u}) {
    cut.stop_after = stop;
    const std::vector<std::string> told = train(2, cut);
    for (const std::string& text : told)
      EXPECT_NE(text.find("stopped after " + std::to_string(stop) + " iterations"),
                std::string::npos)
          << text;
    cut.resume = true;
  }
  cut.stop_after = 0;
  EXPECT_EQ(train(2, cut), whole);
  EXPECT_EQ(checkpoint("cut", "average"), checkpoint("whole", "average"));
  for (const std::string& text : train(2, cut))
    EXPECT_EQ(text.find("bug"), std::string::npos) << "a finished run: " << text;
}

// A run of two ranks may go on with one, and of one with three.
TEST_F(SamplerRanks, MayBeOtherRanksTomorrow) {
  SamplerRequest cut = request("cut", 30);
  cut.stop_after = 10;
  train(2, cut);
  cut.resume = true, cut.stop_after = 20;
  train(1, cut);
  cut.stop_after = 0;
  const std::vector<std::string> told = train(3, cut);
  EXPECT_EQ(told[0].rfind("30 ", 0), 0u) << told[0];
  EXPECT_EQ(told[2], told[0]);
}

TEST_F(SamplerRanks, StopTogetherWhenOneIsInterrupted) {
  SamplerRequest long_run = request("run", 1000000);
  long_run.checkpoint_period_s = 0.05;
  Ranks ranks(2, training(long_run));
  wait_for_checkpoint("run");
  ranks.send(1, SIGTERM);
  const std::string first = ranks.wait(0), second = ranks.wait(1);
  EXPECT_EQ(first.rfind("Interrupted: ", 0), 0u) << first;
  EXPECT_EQ(second.rfind("Interrupted: ", 0), 0u) << second;
  const std::string end = first.substr(first.find("stopped after"));
  EXPECT_NE(second.find(end), std::string::npos) << second << " but " << first;
  EXPECT_EQ(train::read_json(path("run") + "/run.json").at("status"), "interrupted");
}

TEST_F(SamplerRanks, StopTogetherWhenRankZerosTimeIsUp) {
  SamplerRequest timed = request("timed", 0);
  timed.settings.schedule.budget = {.iterations = 0, .seconds = 0.5};
  const std::vector<std::string> told = train(2, timed);
  EXPECT_EQ(told[1], told[0]);
  EXPECT_GT(std::stoull(told[0]), 1u);
}

TEST_F(SamplerRanks, SaveAndEndWhenOneDies) {
  for (const int victim : {1, 0}) {
    SamplerRequest long_run = request("run" + std::to_string(victim), 1000000);
    long_run.checkpoint_period_s = 0.05;
    Ranks ranks(2, training(long_run));
    wait_for_checkpoint("run" + std::to_string(victim));
    ranks.send(victim, SIGKILL);
    const double killed = tests::now_s();
    const std::string told = ranks.wait(1 - victim, 30);
    std::printf("  after %.2f s: %s\n", tests::now_s() - killed, told.c_str());
    EXPECT_EQ(told.rfind("PeerLost: ", 0), 0u) << told;
    EXPECT_EQ(told.find('\n'), std::string::npos) << told;
    EXPECT_EQ(told.find("--resume goes on from there") != std::string::npos, victim == 1) << told;
  }
  EXPECT_EQ(train::read_json(path("run1") + "/run.json").at("status"), "interrupted");
  SamplerRequest resume = request("run1", 0);
  resume.resume = true;
  resume.stop_after = 1;  // stops before its next iteration
  EXPECT_NE(train(2, resume)[1].find("stopped after"), std::string::npos);
}

TEST_F(SamplerRanks, RefuseTogether) {
  train(1, request("run", 2));
  std::vector<std::string> told = train(2, request("run", 2));
  EXPECT_NE(told[0].find("holds a run already"), std::string::npos) << told[0];
  EXPECT_EQ(told[1].rfind("PeerLost: rank 1 of 2: ", 0), 0u) << told[1];
  SamplerRequest small = request("small", 2);
  small.settings.batch = 1;
  told = train(2, small);
  for (const std::string& text : told)
    EXPECT_NE(text.find("a batch of 1 is too small for 2 ranks"), std::string::npos) << text;
  EXPECT_FALSE(fs::exists(path("small"))) << "nothing half-made";
}

}  // namespace
}  // namespace figurine::generate::sampler_ranks_test
