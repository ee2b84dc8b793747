// A trained sampler as a package: the device's integers against the trainer's floats, what all
// avatars share, ranges, golden seeds.
#include "toolchain/generate/pack_sampler.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "figurine/avatar_sampler.h"
#include "figurine/package.h"
#include "runtime/src/sample/device_transformer.h"
#include "runtime/src/sample/noise.h"
#include "runtime/src/sample/weight_decoder.h"
#include "tests/toolchain/generate/small_people.h"
#include "toolchain/error.h"
#include "toolchain/generate/quantised_sampler.h"
#include "toolchain/generate/sampler_trainer.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/verify/device_samples.h"
#include "toolchain/verify/float_sampler.h"
#include "toolchain/verify/golden_seeds.h"
#include "toolchain/verify/sampling_error.h"

namespace figurine::generate::pack_sampler_test {
namespace {

namespace fs = std::filesystem;

class PackSampler : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = fs::temp_directory_path() / ("pack_sampler_test_" + std::to_string(getpid()));
    fs::remove_all(folder());
    fs::create_directories(folder());
    tests::write_people(path("people.fgn"));
    ASSERT_TRUE(
        ports::write_file_atomically(path("body.fgn"), tests::make_test_body().bytes.bytes()).ok());
    SamplerRequest request = request_of("people.fgn", "run");
    train_sampler(request);
    request.run = path("layer"), request.settings.space.variant = Variant::kLayer,
    request.settings.schedule.budget.iterations = 2;
    train_sampler(request);
    request.run = path("velocity"), request.settings.space.variant = Variant::kBasis,
    request.settings.shape.prediction = Prediction::kVelocity;
    train_sampler(request);
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }

  static fs::path& folder() {
    static fs::path folder;
    return folder;
  }
  static std::string path(const std::string& name) { return (folder() / name).string(); }
  static SamplerRequest request_of(const std::string& population, const std::string& run) {
    SamplerRequest request{.population = path(population),
                           .run = path(run),
                           .settings = {},
                           .command = "test",
                           .quiet = true};
    request.settings.space = {.variant = Variant::kBasis, .rank = 8};
    request.settings.shape = {
        .token_sizes = {}, .d_model = 32, .blocks = 2, .heads = 4, .feed_forward = 64};
    request.settings.batch = 8, request.settings.schedule.peak = 3e-3,
    request.settings.schedule.ramp_iterations = 5;
    request.settings.ema = 0.9;
    request.settings.schedule.budget = {.iterations = 200, .seconds = 0};
    return request;
  }
  static PackSamplerOptions options() {
    return {.run = path("run"),
            .body = path("body.fgn"),
            .steps = 8,
            .sample_on_device = verify::sample_golden_seeds,
            .quiet = true};
  }

  static std::string refusal(const PackSamplerOptions& options) {
    try {
      pack_sampler(options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }
};

double relative_error(std::span<const float> a, std::span<const float> b) {
  double error = 0, power = 0;
  for (size_t k = 0; k < a.size(); ++k) {
    error += double(a[k] - b[k]) * (a[k] - b[k]);
    power += double(b[k]) * b[k];
  }
  return std::sqrt(error / power);
}

// Matrices of 127 levels: every product is off by a part in a few hundred.
TEST_F(PackSampler, TheDevicesPredictionIsTheTrainersButForTheRoundingOfMatrices) {
  const TrainedSampler trained = TrainedSampler::open(path("run"));
  const std::vector<Quantisation> ranges(
      trained.population->package.population().network.layers.size());
  const QuantisedSampler quantised(trained, ranges, "people");
  const auto device = DeviceTransformer::create(quantised.view());
  ASSERT_TRUE(device.ok());
  const size_t size = trained.space->size();
  std::vector<float> z(size), x0(size);
  fill_normal(5, 0, z);
  for (const float lambda : {-3.0f, 0.0f, 3.0f}) {
    (*device)->predict(z, lambda, x0);
    const torch::NoGradGuard no_gradient;
    const torch::Tensor out =
        trained.transformer
            ->forward(torch::from_blob(z.data(), {1, static_cast<int64_t>(size)}),
                      torch::full({1}, lambda))
            .contiguous();
    const double error = relative_error(x0, {out.const_data_ptr<float>(), size});
    std::printf("  lambda %g: relative error %.2g\n", static_cast<double>(lambda), error);
    EXPECT_LT(error, 0.03);
    EXPECT_GT(error, 0);  // not the same code
  }
}

TEST_F(PackSampler, DirectionsAreTheSpacesButForTheirRounding) {
  const TrainedSampler trained = TrainedSampler::open(path("run"));
  const QuantisedSampler quantised(trained, {}, "people");
  std::vector<float> weights(quantised.view().mean.size());
  for (Eigen::Index m = 0; m < trained.training.rows(); ++m) {
    const measure::RowVector values = trained.training.row(m);
    decode_weights(quantised.view(), {values.data(), static_cast<size_t>(values.size())}, weights);
    const measure::RowVector truth = trained.space->decode(values),
                             mean = trained.space->standardisation().mean();
    double error = 0, power = 0;
    for (Eigen::Index j = 0; j < truth.size(); ++j) {
      error += std::pow(double{weights[static_cast<size_t>(j)]} - truth[j], 2);
      power += std::pow(truth[j] - mean[j], 2);
    }
    EXPECT_LT(std::sqrt(error / power), 0.02) << "member " << m;
  }
}

TEST_F(PackSampler, ThePackageSaysWhatAllItsAvatarsShare) {
  const tests::AlignedBytes bytes(pack_sampler(options()));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  const Sampler& sampler = opened->sampler();
  const TrainedSampler trained = TrainedSampler::open(path("run"));
  const Population& population = trained.population->package.population();
  EXPECT_EQ(sampler.name, "people");
  EXPECT_EQ(sampler.body_hash, population.body_hash);
  EXPECT_EQ(sampler.population_hash, trained.population->package.content_hash());
  EXPECT_EQ(sampler.shape_count, 2u);
  EXPECT_EQ(sampler.noise.dimension, trained.space->dimension());
  EXPECT_EQ(sampler.steps, 8u);
  EXPECT_EQ(sampler.pose_statistics.joints, population.pose_joints);
  for (const Quantisation& value : sampler.values) EXPECT_GT(value.scale, 0);
  bool says_population = false;
  for (const KeyValue& setting : opened->provenance().settings) {
    says_population = says_population || (setting.key == "population" &&
                                          setting.value == format_hash(sampler.population_hash));
  }
  EXPECT_TRUE(says_population);
}

TEST_F(PackSampler, GoldenSeedsAreWhatADeviceSamples) {
  const tests::AlignedBytes bytes(pack_sampler(options()));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok());
  const Sampler& sampler = opened->sampler();
  ASSERT_EQ(sampler.golden_seeds.size(), 2u);
  const auto device = AvatarSampler::create(sampler);
  ASSERT_TRUE(device.ok());
  for (const GoldenSeed& golden : sampler.golden_seeds) {
    SampledAvatar person;
    ASSERT_TRUE(
        (*device)
            ->sample({.seed = golden.seed, .steps = golden.steps, .method = golden.method}, person)
            .ok());
    EXPECT_EQ(hash_weights(person.avatar().fixed_point, person.avatar().shape), golden.hash);
  }
  EXPECT_NE(sampler.golden_seeds[0].hash, sampler.golden_seeds[1].hash);
}

TEST_F(PackSampler, SeedsOfTheDeviceAreSeedsOfTheTrainersFloats) {
  const tests::AlignedBytes bytes(pack_sampler(options()));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok());
  const auto device = AvatarSampler::create(opened->sampler());
  ASSERT_TRUE(device.ok());
  const TrainedSampler trained = TrainedSampler::open(path("run"));
  const measure::RowMatrix floats =
      verify::draw_weights(trained, {.first_seed = 3, .count = 2, .steps = 8});
  const measure::RowMatrix sampled =
      verify::sample_weights(opened->sampler(), {.first_seed = 3, .count = 2, .quiet = true});
  ASSERT_EQ(sampled.cols(), floats.cols());
  for (uint64_t seed = 3; seed < 5; ++seed) {
    SampledAvatar person;
    ASSERT_TRUE((*device)->sample({.seed = seed}, person).ok());
    std::vector<double> weights(static_cast<size_t>(floats.cols()));
    const Avatar& avatar = person.avatar();
    measure::WeightLayout(avatar.network, avatar.shape.size()).read(avatar, weights);
    EXPECT_TRUE(std::ranges::equal(weights, sampled.row(static_cast<Eigen::Index>(seed - 3))))
        << "as evaluations see them";
    const measure::RowVector mean = trained.space->standardisation().mean();
    const auto row = floats.row(static_cast<Eigen::Index>(seed - 3));
    const double power = (row - mean).squaredNorm();
    const double error =
        (Eigen::Map<const measure::RowVector>(weights.data(), row.size()) - row).squaredNorm();
    std::printf("  seed %llu: relative error %.3f\n", static_cast<unsigned long long>(seed),
                std::sqrt(error / power));
    EXPECT_LT(std::sqrt(error / power), 0.1);
  }
}

// Members that are maps over one network: the space has a token of the shape and one a patch, and a
// device makes the people that the trainer's floats make.
TEST_F(PackSampler, OfOneNetworkSamplesMaps) {
  tests::write_people_of_one_network(path("alike.fgn"));
  SamplerRequest request = request_of("alike.fgn", "alike");
  try {
    train_sampler(request);
    FAIL() << "patches are the body's";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("--body"), std::string::npos) << error.what();
  }
  request.body = path("body.fgn");
  train_sampler(request);
  PackSamplerOptions pack = options();
  pack.run = path("alike");
  const tests::AlignedBytes bytes(pack_sampler(pack));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  const Sampler& sampler = opened->sampler();
  EXPECT_TRUE(sampler.shares_network);
  EXPECT_FALSE(sampler.static_groups.empty());
  const TrainedSampler trained = TrainedSampler::open(path("alike"));
  EXPECT_EQ(sampler_token_sizes(sampler).size(), trained.layout->tokens().size());
  const measure::RowMatrix floats =
      verify::draw_weights(trained, {.first_seed = 3, .count = 2, .steps = 8});
  const measure::RowMatrix sampled =
      verify::sample_weights(sampler, {.first_seed = 3, .count = 2, .quiet = true});
  ASSERT_EQ(sampled.cols(), floats.cols());
  const measure::RowVector mean = trained.space->standardisation().mean();
  for (Eigen::Index row = 0; row < 2; ++row) {
    const double error = std::sqrt((sampled.row(row) - floats.row(row)).squaredNorm() /
                                   (floats.row(row) - mean).squaredNorm());
    std::printf("  seed %d: relative error %.3f\n", int(row) + 3, error);
    EXPECT_LT(error, 0.1);
  }
  const tests::SyntheticBody body = tests::make_test_body();
  const auto device = AvatarSampler::create(sampler);
  ASSERT_TRUE(device.ok());
  SampledAvatar person;
  ASSERT_TRUE((*device)->sample({.seed = 3}, person).ok());
  const Status fits = check_avatar_fits_body(person.avatar(), *body.package);
  EXPECT_TRUE(fits.ok()) << fits.message();
}

TEST_F(PackSampler, TheReportGoesAlong) {
  std::ofstream(path("report.json")) << "{\"rows\": [1, 2]}\n";
  PackSamplerOptions with_report = options();
  with_report.report = path("report.json");
  const tests::AlignedBytes bytes(pack_sampler(with_report));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  EXPECT_EQ(opened->sampler().report, "{\"rows\":[1,2]}");
}

TEST_F(PackSampler, RefusesWhatDoesNotFit) {
  PackSamplerOptions bad = options();
  bad.body.clear();
  EXPECT_NE(refusal(bad).find("--body"), std::string::npos) << refusal(bad);
  bad.body = path("people.fgn");
  EXPECT_NE(refusal(bad).find("people.fgn"), std::string::npos) << refusal(bad);
  ASSERT_TRUE(ports::write_file_atomically(path("other.fgn"),
                                           tests::make_test_body({.seed = 2}).bytes.bytes())
                  .ok());
  bad.body = path("other.fgn");
  EXPECT_NE(refusal(bad).find("stands on body"), std::string::npos) << refusal(bad);
  bad = options();
  bad.run = path("layer");
  EXPECT_NE(refusal(bad).find("layer"), std::string::npos) << refusal(bad);
  bad.run = path("velocity");
  EXPECT_NE(refusal(bad).find("prediction velocity has no package"), std::string::npos)
      << refusal(bad);
  bad.run = path("nowhere");
  EXPECT_NE(refusal(bad).find("nowhere"), std::string::npos) << refusal(bad);
}

TEST_F(PackSampler, MeasuringTheSamplingGivesOrdersAndAFloor) {
  const tests::AlignedBytes bytes(pack_sampler(options()));
  const Result<Package> opened = Package::open(bytes.bytes(), "sampler");
  ASSERT_TRUE(opened.ok());
  const tests::SyntheticBody body = tests::make_test_body();
  const nlohmann::json report = verify::measure_sampling_error(
      TrainedSampler::open(path("run")), opened->sampler(), *body.package,
      {.evaluations = {1, 50, 250}, .seeds = 2, .quiet = true});
  EXPECT_EQ(report.at("rows").size(), 3u * 2 * 3);
  EXPECT_NEAR(report.at("order").at("oracle, float64").at("ddim").get<double>(), 1, 0.2);
  EXPECT_GT(report.at("order").at("network, float32").at("dpmpp2m").get<double>(), 1.5);
  EXPECT_GT(report.at("floor").at("rms_error_of_integers").get<double>(), 0);
}

TEST(PooledPoseStatistics, AreThoseOfAllTrainingMembersTogether) {
  const std::string path =
      (fs::temp_directory_path() / ("pooled_pose_" + std::to_string(getpid()) + ".fgn")).string();
  tests::write_people(path);
  const train::PackageFile file = train::open_package(path, PackageKind::kPopulation);
  fs::remove(path);
  const Population& population = file.package.population();
  std::vector<float> mean, covariance;
  pooled_pose_statistics(population, mean, covariance);
  const size_t size = 3 * population.pose_joints.size();
  ASSERT_EQ(mean.size(), size);
  for (size_t i = 0; i < size; ++i) {
    double sum = 0;
    for (size_t m = 0; m < 5; ++m) sum += population.pose_mean[m * size + i];
    EXPECT_NEAR(mean[i], sum / 5, 1e-6);
    EXPECT_GT(covariance[i * size + i], 0);
    for (size_t j = 0; j < size; ++j) EXPECT_EQ(covariance[i * size + j], covariance[j * size + i]);
  }
}

}  // namespace
}  // namespace figurine::generate::pack_sampler_test
