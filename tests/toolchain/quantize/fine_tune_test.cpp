// Calibration and fine-tuning of a small run: what they may look at, what they leave alone, and
// that they help.
#include "toolchain/quantize/fine_tune.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/toolchain/train/small_capture.h"
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/reconstruction/quantization.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/trainer.h"

namespace figurine::quantize::fine_tune_test {
namespace {

using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// One run that all tests look at.
const std::string& trained_run() {
  static const TemporaryFolder folder;
  static const std::string run = [] {
    train::TrainRequest request{.data = small_capture().data,
                                .body = small_capture().body,
                                .run = folder.path("run"),
                                .settings = train::preset_settings("nano"),
                                .quiet = true};
    request.settings.schedule.budget = {.iterations = 300, .seconds = 0};
    train::train_avatar(request);
    return request.run;
  }();
  return run;
}

FineTuneOptions short_fine_tune() {
  return {.calibration = {.poses = 8}, .iterations = 40, .quiet = true};
}

TEST(Calibration, SharesScalesInGroupsAndGivesReluOutputsZeroPointMinus128) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  std::vector<float> storage;
  const Network network = avatar.model().unet().export_network(storage);
  const ActivationStatistics statistics = observe_activations(avatar, 8);
  EXPECT_EQ(statistics.poses, 8u);
  for (RangeMethod method :
       {RangeMethod::kMinMax, RangeMethod::kPercentile, RangeMethod::kSmallestError}) {
    const Scales scales = choose_scales(network, statistics, {.method = method});
    EXPECT_EQ(scales.values[0].zero_point, 0);
    for (size_t value = 1; value < scales.values.size(); ++value) {
      EXPECT_EQ(scales.values[value], scales.values[statistics.group[value]]) << value;
      EXPECT_EQ(scales.values[value].zero_point, -128) << value;
    }
    EXPECT_NO_THROW(QuantisedNetwork(network, scales));
  }
}

TEST(Calibration, LooksAtNoHeldOutPose) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  uint32_t training = 0;
  for (const dataset::CaptureFrame& frame : avatar.data().frames())
    training += frame.split == dataset::FrameSplit::kTrain;
  ASSERT_LT(training, avatar.data().frames().size());
  EXPECT_EQ(observe_activations(avatar, 1000).poses, training);
}

TEST(Calibration, ScalesSurviveTheFile) {
  const TemporaryFolder folder;
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  std::vector<float> storage;
  const Network network = avatar.model().unet().export_network(storage);
  const Scales scales = choose_scales(network, observe_activations(avatar, 4), {});
  save_scales(folder.path("scales"), scales);
  const Scales loaded = load_scales(folder.path("scales"), network);
  EXPECT_EQ(loaded.values, scales.values);
  EXPECT_EQ(loaded.weight_scale, scales.weight_scale);
  EXPECT_THROW(load_scales(folder.path("scales"), make_pose_unet(32, 26, 16, 14)), InputError);
}

TEST(FineTune, LeavesTheRunAloneAndIsNotRepeated) {
  const std::string weights = bytes_of(train::RunDirectory{trained_run()}.weights());
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  const FineTuned first = fine_tune(avatar, {trained_run()}, short_fine_tune());
  EXPECT_EQ(bytes_of(train::RunDirectory{trained_run()}.weights()), weights);
  EXPECT_NE(bytes_of(first.weights), weights);
  const auto written = std::filesystem::last_write_time(first.weights);
  const FineTuned second = fine_tune(avatar, {trained_run()}, short_fine_tune());
  EXPECT_EQ(std::filesystem::last_write_time(second.weights), written);
  EXPECT_EQ(second.scales.values, first.scales.values);
  FineTuneOptions other = short_fine_tune();
  other.iterations = 41;
  EXPECT_NE(std::filesystem::last_write_time(fine_tune(avatar, {trained_run()}, other).weights),
            written);
}

TEST(EvaluateQuantization, ReportsEveryRowAndTheIntegersAgree) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  const torch::Tensor before = avatar.model().unet().weights().detach().clone();
  const nlohmann::json report =
      reconstruction::evaluate_quantization(avatar, {trained_run()},
                                            {.calibration = {.poses = 8},
                                             .fine_tune = short_fine_tune(),
                                             .motion = "",
                                             .views_per_pose = 2,
                                             .training_poses = 2,
                                             .quiet = true});
  EXPECT_TRUE(torch::equal(before, avatar.model().unet().weights().detach()))
      << "the evaluation gives the network back as it was";
  const nlohmann::json summary = reconstruction::summarise_quantization({report, report});
  for (const char* name : {"ptq", "ptq_minmax", "ptq_percentile", "ptq_mse", "qat", "dynamic",
                           "ptq_int8_input", "ptq_float_head"}) {
    const auto row = std::find_if(summary.at("rows").begin(), summary.at("rows").end(),
                                  [&](const auto& r) { return r.at("name") == name; });
    ASSERT_NE(row, summary.at("rows").end()) << name;
    std::printf("%s: drop %.3f dB, to f32 %.2f dB\n", name, row->at("psnr_drop_db").get<double>(),
                row->at("psnr_to_f32_db").get<double>());
    EXPECT_GT(row->at("psnr_to_f32_db").get<double>(), 25) << name;
  }
  EXPECT_EQ(report.at("layers").size(), 1u + 15u + 3u);
  for (const nlohmann::json& layer : report.at("layers")) {
    EXPECT_GT(layer.at("psnr_to_f32_db").get<double>(),
              report.at("rows").at(0).at("psnr_to_f32_db").get<double>() - 1)
        << layer.dump();
  }
  EXPECT_LE(report.at("integer_reference").at("largest_difference_steps").get<double>(), 1);
  EXPECT_EQ(summary.at("worst_member").at("identity"), report.at("identity"));
}

}  // namespace
}  // namespace figurine::quantize::fine_tune_test
