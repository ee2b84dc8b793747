// The training of a sampler: it learns, it goes on after an interruption with the same bits, it
// learns from the training part alone.
#include "toolchain/generate/sampler_trainer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "ports/host/folder_lock.h"
#include "tests/toolchain/generate/small_people.h"
#include "tests/toolchain/members/small_members.h"
#include "toolchain/error.h"
#include "toolchain/model/threads.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::generate::sampler_trainer_test {
namespace {

namespace fs = std::filesystem;

class SamplerTraining : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("sampler_trainer_test_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    tests::write_people(path("people.fgn"));
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  SamplerRequest request(const std::string& run, Variant variant = Variant::kBasis,
                         uint64_t iterations = 60) const {
    SamplerRequest request{.population = path("people.fgn"),
                           .run = path(run),
                           .settings = {},
                           .command = "test",
                           .quiet = true};
    request.settings.space = {.variant = variant, .rank = 8, .chunk = 128};
    request.settings.shape = {
        .token_sizes = {}, .d_model = 16, .blocks = 1, .heads = 2, .feed_forward = 32};
    request.settings.autoencoder.channels = 2,
    request.settings.autoencoder.schedule.budget = {.iterations = 40, .seconds = 0};
    request.settings.batch = 8, request.settings.schedule.peak = 3e-3,
    request.settings.schedule.ramp_iterations = 5;
    request.settings.schedule.budget = {.iterations = iterations, .seconds = 0};
    return request;
  }

  std::vector<float> weights(const std::string& run) const {
    std::vector<float> all;
    for (const auto& [name, tensor] :
         train::read_tensor_file(path(run) + "/weights.safetensors").tensors) {
      all.insert(all.end(), tensor.values.begin(), tensor.values.end());
    }
    return all;
  }

  // Trains "whole", and "cut", which is stopped half-way and goes on. of: the request of a run.
  void expect_the_same_bits_after_a_stop(
      const std::function<SamplerRequest(const std::string&)>& of) const {
    train_sampler(of("whole"));
    SamplerRequest cut = of("cut");
    cut.stop_after = 31;
    EXPECT_THROW(train_sampler(cut), train::Interrupted);
    cut.resume = true, cut.stop_after = 0;
    train_sampler(cut);
    EXPECT_EQ(weights("cut"), weights("whole"));
  }

  std::string refusal(const SamplerRequest& request) const {
    try {
      train_sampler(request);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }

  fs::path folder_;
};

// The loss of predicting the mean is 1, the mean square of a member.
TEST_F(SamplerTraining, LearnsInEveryVariant) {
  for (const Variant variant :
       {Variant::kLayer, Variant::kFlat, Variant::kLatent, Variant::kBasis}) {
    const std::string run = to_string(variant);
    const SamplerResult result = train_sampler(request(run, variant, 250));
    std::printf("  %s: loss %.3f, validation %.3f\n", run.c_str(), result.loss,
                result.validation_loss);
    EXPECT_LT(result.loss, 0.75) << run;
    EXPECT_TRUE(std::isfinite(result.validation_loss));
    for (const char* file :
         {"run.json", "log.csv", "weights.safetensors", "checkpoint.safetensors"}) {
      EXPECT_TRUE(fs::exists(path(run) + "/" + file)) << file;
    }
  }
}

TEST_F(SamplerTraining, GoesOnWithTheSameBits) {
  train_sampler(request("whole"));
  SamplerRequest cut = request("cut");
  for (const uint64_t stop : {7u, 31u, 50u}) {
    cut.stop_after = stop;
    EXPECT_THROW(train_sampler(cut), train::Interrupted);
    cut.resume = true;
  }
  cut.stop_after = 0;
  const SamplerResult result = train_sampler(cut);
  EXPECT_EQ(result.iteration, 60u);
  EXPECT_EQ(weights("cut"), weights("whole"));
  EXPECT_TRUE(train_sampler(cut).was_finished);
  SamplerRequest other = request("other");
  other.settings.seed = 2;
  train_sampler(other);
  EXPECT_NE(weights("other"), weights("whole"));
}

TEST_F(SamplerTraining, OneProcessTrainsARun) {
  SamplerRequest cut = request("cut");
  cut.stop_after = 3;
  EXPECT_THROW(train_sampler(cut), train::Interrupted);
  cut.resume = true, cut.stop_after = 0;
  {
    const auto lock = ports::FolderLock::acquire(path("cut"));
    ASSERT_TRUE(lock.ok());
    EXPECT_EQ(refusal(cut), "cannot train: " + path("cut") + ": another process is at work in it");
  }
  EXPECT_EQ(train_sampler(cut).iteration, 60u);
}

TEST_F(SamplerTraining, GoesOnWithItsOwnThreadsUnlessToldOtherwise) {
  SamplerRequest cut = request("cut");
  cut.settings.threads = 1, cut.stop_after = 3;
  EXPECT_THROW(train_sampler(cut), train::Interrupted);
  cut.resume = true, cut.stop_after = 5;
  for (const auto& [asked, used] : {std::pair{0u, 1}, {2u, 2}}) {
    model::use_threads(3);
    cut.settings.threads = asked;
    EXPECT_THROW(train_sampler(cut), train::Interrupted);
    EXPECT_EQ(at::get_num_threads(), used) << "asked for " << asked;
    cut.stop_after += 2;
  }
  model::use_threads(1);
}

// Stopped in the autoencoder, and in the denoiser that follows.
TEST_F(SamplerTraining, GoesOnWithTheSameBitsFromTheAutoencoder) {
  const SamplerResult whole = train_sampler(request("whole", Variant::kLatent));
  SamplerRequest cut = request("cut", Variant::kLatent);
  for (const uint64_t stop : {7u, 50u}) {
    cut.stop_after = stop;
    EXPECT_THROW(train_sampler(cut), train::Interrupted);
    EXPECT_EQ(fs::exists(path("cut") + "/weights.safetensors"), stop == 50);
    cut.resume = true;
    cut.settings.autoencoder.channels = 3;  // the run's own settings count
  }
  cut.stop_after = 0;
  EXPECT_EQ(train_sampler(cut).weights_hash, whole.weights_hash);
  EXPECT_EQ(weights("cut"), weights("whole"));
  const TrainedSampler sampler = TrainedSampler::open(path("cut"));
  EXPECT_NEAR(sampler.training.squaredNorm() / static_cast<double>(sampler.training.size()), 1,
              1e-9)
      << "of unit scale";
  const measure::RowVector back = sampler.space->decode(sampler.training.row(0));
  EXPECT_EQ(back.size(), sampler.space->standardisation().mean().size());
  EXPECT_TRUE(back.array().isFinite().all());
  fs::remove(path("cut") + "/autoencoder.safetensors");
  EXPECT_THROW(TrainedSampler::open(path("cut")), InputError);
}

// Mixed people are as reproducible as members, and are something else to learn from.
TEST_F(SamplerTraining, GoesOnWithTheSameBitsOnMixedPeople) {
  const tests::SmallMembers people({.own_networks = false});
  ASSERT_TRUE(ports::write_file_atomically(path("mixed.fgn"), people.bytes.bytes()).ok());
  ASSERT_TRUE(ports::write_file_atomically(path("body.fgn"), people.body.bytes.bytes()).ok());
  const auto mixing = [&](const std::string& run, double share, size_t pieces = 1) {
    SamplerRequest request = this->request(run);
    request.population = path("mixed.fgn"), request.body = path("body.fgn");
    request.settings.mixed_share = share, request.settings.pieces = pieces;
    return request;
  };
  expect_the_same_bits_after_a_stop([&](const std::string& run) { return mixing(run, 0.8); });
  train_sampler(mixing("members", 0));
  EXPECT_NE(weights("members"), weights("whole"));
  train_sampler(mixing("pieces", 0.8, 12));
  const TrainedSampler one = TrainedSampler::open(path("whole")),
                       many = TrainedSampler::open(path("pieces"));
  EXPECT_GT(many.space->token_sizes().size(), one.space->token_sizes().size() + 6);
  EXPECT_EQ(one.training.rows(), 5) << "mixed people are no members";
  SamplerRequest latent = mixing("latent", 0.5);
  latent.settings.space.variant = Variant::kLatent;
  EXPECT_NE(refusal(latent).find("nobody can be mixed"), std::string::npos);
  SamplerRequest mapless = request("mapless");
  mapless.settings.mixed_share = 0.5;
  EXPECT_NE(refusal(mapless).find("no static values"), std::string::npos);
}

// The loss of a velocity is |eps - x|^2 where nothing is known: 2.
TEST_F(SamplerTraining, LearnsByFlowMatching) {
  SamplerRequest flow = request("flow", Variant::kBasis, 250);
  flow.settings.shape.prediction = Prediction::kVelocity;
  const SamplerResult result = train_sampler(flow);
  std::printf("  loss %.3f, validation %.3f\n", result.loss, result.validation_loss);
  EXPECT_LT(result.loss, 1.6);
  EXPECT_TRUE(std::isfinite(result.validation_loss));
  EXPECT_EQ(TrainedSampler::open(path("flow")).transformer->shape().prediction,
            Prediction::kVelocity);
}

TEST_F(SamplerTraining, GoesOnWithTheSameBitsUnderDropout) {
  expect_the_same_bits_after_a_stop([&](const std::string& run) {
    SamplerRequest request = this->request(run);
    request.settings.dropout = 0.2;
    return request;
  });
  train_sampler(request("none"));
  EXPECT_NE(weights("none"), weights("whole"));
}

TEST_F(SamplerTraining, NeverLooksAtTheTestPart) {
  train_sampler(request("before"));
  tests::write_people(path("people.fgn"), true);
  train_sampler(request("after"));
  EXPECT_EQ(weights("after"), weights("before"));
}

TEST_F(SamplerTraining, OpensWhatItTrained) {
  train_sampler(request("run"));
  const TrainedSampler sampler = TrainedSampler::open(path("run"));
  EXPECT_EQ(sampler.training.rows(), 5);
  EXPECT_EQ(static_cast<size_t>(sampler.training.cols()), sampler.space->size());
  const std::vector<float> kept = weights("run");
  EXPECT_EQ(static_cast<size_t>(sampler.transformer->weights().numel()), kept.size());
  tests::write_people(path("people.fgn"), true);
  EXPECT_THROW(TrainedSampler::open(path("run")), InputError) << "another population";
}

TEST_F(SamplerTraining, NamesWhatIsWrong) {
  train_sampler(request("run", Variant::kBasis, 2));
  EXPECT_NE(refusal(request("run")).find("holds a run already"), std::string::npos);
  SamplerRequest resume = request("nowhere");
  resume.resume = true;
  EXPECT_NE(refusal(resume).find("no run to resume"), std::string::npos);
  SamplerRequest many = request("many");
  many.settings.members = 6;
  EXPECT_NE(refusal(many).find("has 5 training members, 6 were asked for"), std::string::npos);
  EXPECT_FALSE(fs::exists(path("many"))) << "nothing half-made";
  SamplerRequest ends = request("ends");
  ends.settings.clean_snr = 1e-9;
  EXPECT_NE(refusal(ends), "accepted");
  SamplerRequest heads = request("heads");
  heads.settings.shape.heads = 5;
  EXPECT_NE(refusal(heads).find("d_model"), std::string::npos);
  tests::write_people(path("people.fgn"), true);
  SamplerRequest moved = request("run");
  moved.resume = true;
  EXPECT_NE(refusal(moved).find("was trained on population"), std::string::npos);
  std::ofstream(path("run") + "/run.json") << "{}";
  EXPECT_NE(refusal(moved).find("is no run of figurine-train sampler"), std::string::npos);
}

}  // namespace
}  // namespace figurine::generate::sampler_trainer_test
