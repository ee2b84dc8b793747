// figurine-features as a way to compare pictures: a distance that behaves like one and grows with
// damage, numbers that do not depend on who computes them, a file that is read back to the bit and
// refused where it is unsound.
#include "toolchain/features/feature_network.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "people.h"
#include "rectangles.h"
#include "toolchain/features/figurine_features.h"
#include "toolchain/features/retrieval.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::features::feature_network_test {

using measure::Picture;
using measure::RowMatrix;

namespace {

using test::input_error;
using test::rectangles;

std::vector<LayerWeights> equal_weights() {
  std::vector<LayerWeights> weights;
  for (const FeatureStage& stage : kFeatureStages)
    weights.push_back({torch::full({stage.out}, 0.25f), 0.75});
  return weights;
}

// Not trained: what follows is the arithmetic's doing.
FigurineFeatures make_network(uint64_t seed = 1) {
  return FigurineFeatures(initial_feature_weights(seed), equal_weights(),
                          {{"population", "nobody"}});
}

TEST(RgbPictures, ArePremultipliedColoursOverMidGrey) {
  const Picture picture{2, 1, {0, 0, 0, 0, 100, 0, 50, 100}};
  const Picture pictures[] = {picture, picture};
  const RgbPictures rgb = over_grey(pictures);
  ASSERT_EQ(rgb.size(), 2u);
  EXPECT_EQ(rgb[1].values[0], 0.5f);                               // nobody there
  EXPECT_FLOAT_EQ(rgb[1].values[1], (100 + 155 * 0.5f) / 255);     // red, second pixel
  EXPECT_FLOAT_EQ(rgb[1].values[2 + 1], (155 * 0.5f) / 255);       // green
  EXPECT_FLOAT_EQ(rgb[1].values[4 + 1], (50 + 155 * 0.5f) / 255);  // blue
  EXPECT_EQ(over_grey({}).size(), 0u);
}

TEST(FigurineFeatures, IsSmallEnoughToBeCommitted) {
  std::printf("  %lld parameters\n", static_cast<long long>(feature_parameter_count()));
  EXPECT_LT(feature_parameter_count(), 250'000) << "under 1 MB in float";
  EXPECT_EQ(make_network().dimension(), 32u);
  EXPECT_EQ(make_network().name(), "figurine-features");
}

TEST(FigurineFeatures, FeaturesHaveOneLengthAndTellPicturesApart) {
  const RowMatrix features = make_network().features(rectangles(128, 128, 3, 1));
  for (Eigen::Index i = 0; i < features.rows(); ++i)
    EXPECT_NEAR(features.row(i).squaredNorm(), 32, 1e-4);
  EXPECT_GT((features.row(0) - features.row(1)).norm(), 1e-3);
}

// Memory as a process has it after some work: freed blocks of all sizes that the network's copies
// have, full of NaN.
void leave_nan_behind() {
  std::vector<torch::Tensor> blocks;
  for (const int64_t channels : {3, 16, 24, 32, 48, 64, 72, 80, 96}) {
    for (const int64_t values : {1, 25 * 16, 9 * 24, 9 * 48, 9 * 80, 9 * 96, 64, 256, 1024, 4096,
                                 8 * 64, 8 * 256, 8 * 1024, 8 * 4096}) {
      for (int copy = 0; copy < 3; ++copy) blocks.push_back(torch::full({channels * values}, NAN));
    }
  }
}

TEST(FigurineFeatures, DoNotDependOnWhatMemoryHeldBefore) {
  const torch::Tensor weights = initial_feature_weights(3).requires_grad_(),
                      pictures = torch::full({8, 3, kFeatureSide_px, kFeatureSide_px}, 0.25);
  const auto run = [&] {
    const FeatureOutput output = run_feature_network(weights, pictures);
    return std::pair{output.features.detach(),
                     torch::autograd::grad({output.features.sum()}, {weights})[0]};
  };
  const auto [features, gradient] = run();
  ASSERT_TRUE(features.isfinite().all().item<bool>() && gradient.isfinite().all().item<bool>());
  for (int i = 0; i < 3; ++i) {
    leave_nan_behind();
    const auto [again, gradient_again] = run();
    EXPECT_TRUE(again.equal(features));
    EXPECT_TRUE(gradient_again.equal(gradient));
  }
}

TEST(FigurineFeatures, DistanceIsZeroForEqualPicturesAndSymmetric) {
  const FigurineFeatures network = make_network();
  const RgbPictures pictures = rectangles(160, 160, 3, 2);
  const RowMatrix all = network.distances(pictures, pictures);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      EXPECT_EQ(network.distance(pictures[i], pictures[j]), all(Eigen::Index(i), Eigen::Index(j)));
      EXPECT_EQ(all(Eigen::Index(i), Eigen::Index(j)), all(Eigen::Index(j), Eigen::Index(i)));
      if (i == j) {
        EXPECT_EQ(all(Eigen::Index(i), Eigen::Index(j)), 0);
      } else {
        EXPECT_GT(all(Eigen::Index(i), Eigen::Index(j)), 0);
      }
    }
  }
}

TEST(FigurineFeatures, DistanceGrowsWithBlurAndNoise) {
  const FigurineFeatures network = make_network();
  const RgbPictures pictures = rectangles(128, 128, 4, 3);
  for (size_t i = 0; i < pictures.size(); ++i) {
    double before = 0;
    for (const double deviation_px : {0.5, 1.0, 2.0, 4.0}) {
      const double distance = network.distance(pictures[i], blurred(pictures, deviation_px)[i]);
      EXPECT_GT(distance, before) << "blur " << deviation_px;
      before = distance;
    }
    before = 0;
    for (const double deviation : {0.01, 0.03, 0.1, 0.3}) {
      const double distance = network.distance(pictures[i], noisy(pictures, deviation, 7)[i]);
      EXPECT_GT(distance, before) << "noise " << deviation;
      before = distance;
    }
  }
}

// By hand: two layers' worth of arithmetic is LPIPS' own test (user_networks_test.cpp); here that
// the distance is made of the stages.
TEST(FigurineFeatures, InALossHasTheDistanceOfReportsAndAGradientDownwards) {
  const test::TemporaryFolder folder;
  make_network().save(folder / "features.safetensors");
  const LossNetwork network = open_loss_network(folder / "features.safetensors");
  EXPECT_EQ(network.name, "figurine-features");
  const RgbPictures pictures = rectangles(128, 128, 2, 4);
  const torch::Tensor truth = to_tensor(pictures[1])[0].clone(),
                      seen = to_tensor(pictures[0])[0].clone().requires_grad_();
  const torch::Tensor distance = network.distance->between(seen, truth);
  const double expected = make_network().distance(pictures[0], pictures[1]);
  EXPECT_NEAR(distance.item<double>(), expected, 1e-5 * expected);
  distance.backward();
  const torch::NoGradGuard no_gradient;
  const double squared = seen.grad().square().sum().item<double>();
  ASSERT_GT(squared, 0);
  // Against the gradient the distance falls as it says, to first order.
  const double step = 1e-3 * expected / squared;
  const double fall =
      expected - network.distance->between(seen - step * seen.grad(), truth).item<double>();
  std::printf("  falls by %.4f of what the gradient says\n", fall / (step * squared));
  EXPECT_NEAR(fall, step * squared, 0.1 * step * squared);
  // Pictures of a loss need not be square.
  EXPECT_GT(network.distance->between(seen.narrow(1, 0, 50), truth.narrow(1, 0, 50)).item<double>(),
            0);
}

TEST(LossNetworks, AreRefusedByNameWhateverTheFileClaimsToBe) {
  const test::TemporaryFolder folder;
  for (const char* name : {"text.safetensors", "text.npz", "text.pt"}) {
    const std::string path = folder / name;
    std::ofstream(path) << "no network";
    const std::string message = input_error([&] { open_loss_network(path); });
    EXPECT_TRUE(message.starts_with(path + ": ") && test::is_one_line(message)) << message;
  }
  const std::string missing = input_error([&] { open_loss_network(folder / "none.safetensors"); });
  EXPECT_NE(missing.find("none.safetensors"), std::string::npos) << missing;
}

TEST(FigurineFeatures, DistanceIsThatOfTheStages) {
  const FigurineFeatures network = make_network();
  const RgbPictures pictures = rectangles(128, 128, 2, 4);
  const torch::NoGradGuard no_gradient;
  std::vector<torch::Tensor> layers[2];
  for (size_t i = 0; i < 2; ++i) {
    layers[i] = run_feature_network(initial_feature_weights(1), prepare_for_features(pictures[i]))
                    .activations;
  }
  double expected = 0;
  for (size_t l = 0; l < kFeatureLayers; ++l) {
    const torch::Tensor a = layers[0][l].to(torch::kFloat64).contiguous(),
                        b = layers[1][l].to(torch::kFloat64).contiguous();
    const int64_t channels = a.size(1), positions = a.size(2) * a.size(3);
    const double *x = a.data_ptr<double>(), *y = b.data_ptr<double>();
    for (int64_t p = 0; p < positions; ++p) {
      double xx = 0, yy = 0;
      for (int64_t c = 0; c < channels; ++c)
        xx += x[c * positions + p] * x[c * positions + p],
            yy += y[c * positions + p] * y[c * positions + p];
      for (int64_t c = 0; c < channels; ++c) {
        const double d = x[c * positions + p] / (std::sqrt(xx) + 0.75) -
                         y[c * positions + p] / (std::sqrt(yy) + 0.75);
        expected += 0.25 * d * d / static_cast<double>(positions);
      }
    }
  }
  const double found = network.distance(pictures[0], pictures[1]);
  std::printf("  distance %.6f, relative error %.1e\n", found, std::abs(found / expected - 1));
  EXPECT_NEAR(found, expected, 1e-5 * expected);
}

TEST(FigurineFeatures, NumbersDoNotDependOnThreadsOrCompany) {
  const FigurineFeatures network = make_network();
  const RgbPictures pictures = rectangles(192, 192, 5, 5);
  const RowMatrix one = network.features(pictures, 1);
  const std::vector<std::vector<float>> embedded = network.embed(pictures, 1);
  for (const uint32_t threads : {2u, 3u, 8u}) {
    EXPECT_EQ(network.features(pictures, threads), one) << threads;
    EXPECT_EQ(network.embed(pictures, threads), embedded) << threads;
  }
  for (size_t i = 0; i < pictures.size(); ++i) {
    const RgbView view = pictures[i];
    const RgbPictures alone{
        view.width_px, view.height_px, {view.values.begin(), view.values.end()}};
    EXPECT_EQ(network.features(alone, 2), one.row(Eigen::Index(i))) << "in a batch of its own";
  }
}

// A triangle as wide as the ratio, its weights adding up to 1, cut off at the edges.
std::vector<double> shrunk_line(const std::vector<double>& line, size_t count) {
  const double ratio = static_cast<double>(line.size()) / static_cast<double>(count);
  std::vector<double> out;
  for (size_t i = 0; i < count; ++i) {
    double sum = 0, weights = 0;
    for (size_t j = 0; j < line.size(); ++j) {
      const double weight = std::max(0.0, 1 - std::abs((static_cast<double>(j) + 0.5) / ratio -
                                                       (static_cast<double>(i) + 0.5)));
      sum += weight * line[j], weights += weight;
    }
    out.push_back(sum / weights);
  }
  return out;
}

TEST(FigurineFeatures, ShrinksLargePicturesByATriangle) {
  constexpr size_t kSide = kFeatureSide_px;
  double worst = 0;
  for (const uint32_t side : {128u, 192u, 256u}) {
    const RgbPictures large = rectangles(side, side, 1, 6);
    const torch::Tensor found = prepare_for_features(large[0]);
    ASSERT_EQ(found.sizes(), at::IntArrayRef({1, 3, kFeatureSide_px, kFeatureSide_px}));
    const float* values = found.data_ptr<float>();
    for (size_t c = 0; c < 3; ++c) {
      std::vector<std::vector<double>>
          narrow;  // rows of the large picture, columns of the small one
      for (size_t y = 0; y < side; ++y) {
        const auto row = large.values.begin() + static_cast<std::ptrdiff_t>((c * side + y) * side);
        narrow.push_back(shrunk_line({row, row + side}, kSide));
      }
      for (size_t x = 0; x < kSide; ++x) {
        std::vector<double> column;
        for (const std::vector<double>& row : narrow) column.push_back(row[x]);
        const std::vector<double> expected = shrunk_line(column, kSide);
        for (size_t y = 0; y < kSide; ++y)
          worst = std::max(worst, std::abs(expected[y] - values[(c * kSide + y) * kSide + x]));
      }
    }
  }
  std::printf("  largest error of a shrunk picture %.1e\n", worst);
  EXPECT_LT(worst, 1e-6);  // sums of a few floats
}

TEST(FigurineFeatures, RefusesOblongPictures) {
  const std::string message =
      input_error([&] { make_network().features(rectangles(128, 96, 1, 1)); });
  EXPECT_NE(message.find("must be square, not 128x96"), std::string::npos) << message;
}

TEST(FigurineFeatures, IsReadBackToTheBit) {
  const test::TemporaryFolder folder;
  const FigurineFeatures network = make_network();
  network.save(folder / "f.safetensors");
  const FigurineFeatures read = FigurineFeatures::load(folder / "f.safetensors");
  const RgbPictures pictures = rectangles(128, 128, 2, 8);
  EXPECT_EQ(read.features(pictures), network.features(pictures));
  EXPECT_EQ(read.distance(pictures[0], pictures[1]), network.distance(pictures[0], pictures[1]));
  EXPECT_EQ(read.describe().at("provenance").at("population"), "nobody");
  EXPECT_EQ(read.describe().at("hash").get<std::string>().size(), 32u);
}

TEST(FigurineFeatures, RefusesUnsoundFiles) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "f.safetensors";
  make_network().save(path);
  const train::TensorFile sound = train::read_tensor_file(path);
  const auto refusal = [&](const std::function<void(train::TensorFile&)>& change) {
    train::TensorFile file = sound;
    change(file);
    train::write_tensor_file(path, file);
    const std::string message = input_error([&] { FigurineFeatures::load(path); });
    EXPECT_TRUE(message.starts_with(path + ": ") && test::is_one_line(message)) << message;
    return message;
  };
  EXPECT_NE(refusal([](auto& file) {
              file.metadata["format"] = "other";
            }).find("format: is no file of figurine-train features"),
            std::string::npos);
  EXPECT_NE(
      refusal([](auto& file) { file.tensors.erase("stage.2.bias"); }).find("stage.2.bias: missing"),
      std::string::npos);
  EXPECT_NE(refusal([](auto& file) {
              file.tensors["embedding.bias"] = {{3}, {1, 2, 3}};
            }).find("embedding.bias: is of another shape"),
            std::string::npos);
  EXPECT_NE(refusal([](auto& file) {
              file.tensors["distance.1.channel_weight"].values[0] = -1;
            }).find("distance.1.channel_weight: holds a negative weight"),
            std::string::npos);
  EXPECT_NE(refusal([](auto& file) {
              file.tensors["distance.0.floor"].values[0] = 0;
            }).find("distance.0.floor: is not above 0"),
            std::string::npos);
  EXPECT_NE(input_error([&] { FigurineFeatures::load(folder / "none"); }).find("none"),
            std::string::npos);
  EXPECT_TRUE(open_networks({}).features.empty());
}

TEST(Blur, KeepsWhatIsFlatAndTheMean) {
  const RgbPictures flat{9, 7, std::vector<float>(9 * 7 * 3, 0.25f)};
  for (const float value : blurred(flat, 1.5).values) EXPECT_NEAR(value, 0.25f, 1e-6);
  RgbPictures point{21, 21, std::vector<float>(21 * 21 * 3, 0)};
  point.values[10 * 21 + 10] = 1;
  const RgbPictures spread = blurred(point, 1);
  double sum = 0, second = 0;
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 21; ++x)
      sum += spread.values[y * 21 + x], second += (x - 10) * (x - 10) * spread.values[y * 21 + x];
  }
  EXPECT_NEAR(sum, 1, 1e-5);
  EXPECT_NEAR(second, 1, 0.03);  // cut off at three deviations
}

}  // namespace
}  // namespace figurine::features::feature_network_test
