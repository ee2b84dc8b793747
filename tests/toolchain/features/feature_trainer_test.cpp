// Training figurine-features: it learns, it goes on after an interruption with the same bits on any
// number of threads, it opens nobody but the training members; and its evaluation finds people
// again.
#include "toolchain/features/feature_trainer.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "people.h"
#include "toolchain/features/figurine_features.h"
#include "toolchain/features/retrieval.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::features::feature_trainer_test {
namespace {

namespace fs = std::filesystem;
using test::input_error;

class FeatureTraining : public ::testing::Test {
 protected:
  void SetUp() override {
    test::write_people(path("people.fgn"));
    test::write_body(path("body.fgn"));
  }
  std::string path(const std::string& name) const { return folder_ / name; }

  FeatureRequest request(const std::string& name, uint64_t iterations = 14) const {
    FeatureRequest request{.population = path("people.fgn"),
                           .body = path("body.fgn"),
                           .output = path(name + ".safetensors")};
    request.settings.poses = 2, request.settings.views = 3,
    request.settings.batch = 12;  // a piece of eight and one of four
    request.settings.schedule.ramp_iterations = 5,
    request.settings.schedule.budget = {.iterations = iterations, .seconds = 0};
    request.command = "test", request.threads = 2, request.quiet = true;
    return request;
  }

  std::map<std::string, std::vector<float>> tensors(const std::string& name) const {
    std::map<std::string, std::vector<float>> all;
    for (const auto& [key, tensor] : train::read_tensor_file(path(name + ".safetensors")).tensors)
      all[key] = tensor.values;
    return all;
  }

  std::string refusal(const FeatureRequest& request) const {
    const std::string message = input_error([&] { train_features(request); });
    EXPECT_TRUE(test::is_one_line(message)) << message;
    return message;
  }

  test::TemporaryFolder folder_;
};

TEST_F(FeatureTraining, GoesOnWithTheSameBitsOnAnyNumberOfThreads) {
  train_features(request("whole"));
  FeatureRequest cut = request("cut");
  for (const uint64_t stop : {3u, 9u}) {
    cut.stop_after = stop, cut.threads = static_cast<uint32_t>(stop / 3);
    EXPECT_THROW(train_features(cut), train::Interrupted);
    EXPECT_FALSE(fs::exists(cut.output)) << "nothing half-trained";
    EXPECT_TRUE(fs::exists(cut.output + ".checkpoint"));
    cut.resume = true;
  }
  cut.stop_after = 0;
  cut.settings.seed = 77, cut.settings.batch = 5;  // the checkpoint's own settings count
  const FeatureResult result = train_features(cut);
  EXPECT_EQ(result.iteration, 14u);
  EXPECT_EQ(result.members, 5u);
  EXPECT_EQ(result.pictures, 30u);
  EXPECT_EQ(tensors("cut"), tensors("whole"));
  EXPECT_FALSE(fs::exists(cut.output + ".checkpoint"));
  EXPECT_TRUE(train_features(cut).was_finished);
  FeatureRequest other = request("other");
  other.settings.seed = 2;
  train_features(other);
  EXPECT_NE(tensors("other"), tensors("whole"));
}

TEST_F(FeatureTraining, OpensNobodyButTrainingMembers) {
  train_features(request("before"));
  test::write_people(path("people.fgn"),
                     {.other_from = 5});  // the validation and the test member are other people now
  train_features(request("after"));
  EXPECT_EQ(tensors("after"), tensors("before"));
  test::write_people(path("people.fgn"), {.other_from = 4});
  train_features(request("other"));
  EXPECT_NE(tensors("other"), tensors("before")) << "the last training member is another";
}

TEST_F(FeatureTraining, TheFileSaysWhereItComesFrom) {
  train_features(request("run", 2));
  const FigurineFeatures network = FigurineFeatures::load(path("run.safetensors"));
  const auto& provenance = network.provenance();
  EXPECT_EQ(provenance.at("population"), "people");
  EXPECT_EQ(provenance.at("population_hash"),
            format_hash(train::open_package(path("people.fgn"), PackageKind::kPopulation)
                            .package.content_hash()));
  EXPECT_EQ(nlohmann::json::parse(provenance.at("members")),
            nlohmann::json({"person0", "person1", "person2", "person3", "person4"}));
  EXPECT_EQ(nlohmann::json::parse(provenance.at("settings")).at("seed"), 1);
  for (const char* key : {"tool", "command", "commit", "machine", "body_hash", "created",
                          "train_seconds", "loss", "accuracy"}) {
    EXPECT_TRUE(provenance.contains(key)) << key;
  }
}

// Two training members in one shot are 1 apart on average; the held-out ones, random weights too,
// not far from that.
TEST_F(FeatureTraining, LearnsToTellPeopleApart) {
  test::write_people(path("people.fgn"), {.training = 6, .validation = 2, .test = 3});
  const FeatureResult result = train_features(request("run", 60));
  std::printf("  loss %.3f, %.0f %% told right\n", result.loss, 100 * result.accuracy);
  EXPECT_GT(result.accuracy, 0.6) << "chance is 17 %";
  const ComparingNetworks networks =
      open_networks({.features = path("run.safetensors"), .lpips = "", .inception = ""});
  ASSERT_EQ(networks.features.size(), 1u);
  const train::PackageFile population =
                               train::open_package(path("people.fgn"), PackageKind::kPopulation),
                           body = train::open_package(path("body.fgn"), PackageKind::kBody);
  const nlohmann::json report =
      evaluate_networks(population.package, body.package, networks,
                        {.first_pose = 2, .poses = 2, .views = 2, .threads = 2, .quiet = true});
  for (const char* part : {"held_out", "training"}) {
    const nlohmann::json& found = report.at(part);
    EXPECT_EQ(found.at("members"), 5) << "as many training members as held-out ones";
    EXPECT_EQ(found.at("queries"), 5 * 4);
    EXPECT_DOUBLE_EQ(found.at("chance").get<double>(), 0.2);
    for (const char* kind : {"features", "distance"}) {
      const double share = found.at(kind).at("figurine-features").get<double>();
      std::printf("  %s, %s: %.0f %% found, pixels %.0f %%\n", part, kind, 100 * share,
                  100 * found.at("pixels").get<double>());
      EXPECT_GT(share, 0.4) << part << ' ' << kind;
    }
  }
  const nlohmann::json& scale = report.at("scale").at("figurine-features");
  EXPECT_GT(scale.at("other_person_same_shot").get<double>(), 0.3);
  EXPECT_LT(scale.at("other_person_same_shot").get<double>(), 3);
  EXPECT_EQ(scale.at("blur").size(), 3u);
}

TEST_F(FeatureTraining, StopsAtCtrlC) {
  FeatureRequest endless = request("run", 1u << 20);
  endless.checkpoint_period_s = 0;
  std::thread user([&] {  // the first checkpoint tells that training is under way
    while (!fs::exists(endless.output + ".checkpoint"))
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::raise(SIGINT);
  });
  EXPECT_THROW(train_features(endless), train::Interrupted);
  user.join();
  EXPECT_TRUE(fs::exists(endless.output + ".checkpoint"));
}

TEST_F(FeatureTraining, NamesWhatIsWrong) {
  FeatureRequest cut = request("cut");
  cut.stop_after = 1;
  EXPECT_THROW(train_features(cut), train::Interrupted);
  EXPECT_NE(refusal(cut).find("is of a training that was stopped; --resume goes on with it"),
            std::string::npos);
  cut.resume = true;
  test::write_people(path("people.fgn"), {.other_from = 5});
  EXPECT_NE(refusal(cut).find("population_hash is "), std::string::npos);
  FeatureRequest nowhere = request("nowhere");
  nowhere.resume = true;
  EXPECT_NE(refusal(nowhere).find("no training to resume"), std::string::npos);
  FeatureRequest body = request("body");
  test::write_body(path("other_body.fgn"), 2);
  body.body = path("other_body.fgn");
  EXPECT_NE(refusal(body).find("population 'people': "), std::string::npos);
  body.body = path("people.fgn");
  EXPECT_NE(refusal(body).find("is a package of kind population, not body"), std::string::npos);
  test::write_people(path("people.fgn"), {.training = 1, .validation = 2, .test = 1});
  EXPECT_NE(refusal(request("one")).find("has 1 training members, at least 2 are needed"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(path("one.safetensors.checkpoint")));
}

TEST_F(FeatureTraining, EvaluationRefusesWhoeverWasLearntFrom) {
  train_features(request("run", 2));
  const std::string file = path("run.safetensors");
  const train::PackageFile population =
                               train::open_package(path("people.fgn"), PackageKind::kPopulation),
                           body = train::open_package(path("body.fgn"), PackageKind::kBody);
  const auto refused = [&] {
    return input_error([&] {
      evaluate_networks(population.package, body.package,
                        open_networks({.features = file, .lpips = "", .inception = ""}),
                        {.first_pose = 0, .poses = 2, .views = 2, .quiet = true});
    });
  };
  EXPECT_EQ(refused(), "none");
  train::TensorFile tensors = train::read_tensor_file(file);
  tensors.metadata["members"] = R"(["person0", "person6"])";
  train::write_tensor_file(file, tensors);
  EXPECT_NE(refused().find("members: learnt from 'person6', who is held out"), std::string::npos);
}

}  // namespace
}  // namespace figurine::features::feature_trainer_test
