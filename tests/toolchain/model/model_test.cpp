// The trainer's model on LibTorch: UNet, renderer node, loss and optimiser against references that
// share no code with them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "tests/toolchain/model/random_tensor.h"
#include "tests/toolchain/model/synthetic_body.h"
#include "toolchain/error.h"
#include "toolchain/model/loss.h"
#include "toolchain/model/muon.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/model/render.h"
#include "toolchain/model/ssim.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model::model_test {
namespace {

using testing_tools::random_tensor;
using testing_tools::to_double;

// The network's definition (figurine/network.h), evaluated value by value in double. input:
// [T,T,C].
std::vector<double> evaluate(const Network& network, const std::vector<double>& input) {
  const std::vector<ValueShape> shapes = *infer_shapes(network, true);
  std::vector<std::vector<double>> values{input};
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    const std::vector<double>& a = values[layer.inputs[0]];
    const ValueShape in = shapes[layer.inputs[0]], shape = shapes[i + 1];
    const int size = static_cast<int>(in.size);
    std::vector<double> out(size_t(shape.size) * shape.size * shape.channels);
    for (int y = 0; y < static_cast<int>(shape.size); ++y) {
      for (int x = 0; x < static_cast<int>(shape.size); ++x) {
        for (uint32_t c = 0; c < shape.channels; ++c) {
          const auto at = [&](int v, int u, uint32_t channel) {
            return a[(size_t(v) * in.size + u) * in.channels + channel];
          };
          double value = 0;
          if (layer.op == LayerOp::kConv2d) {
            const int k = static_cast<int>(layer.kernel);
            value = layer.bias[c];
            for (int dy = 0; dy < k; ++dy) {
              for (int dx = 0; dx < k; ++dx) {
                const int v = y + dy - k / 2, u = x + dx - k / 2;
                if (v < 0 || u < 0 || v >= size || u >= size) continue;
                for (uint32_t ic = 0; ic < in.channels; ++ic)
                  value += at(v, u, ic) *
                           layer.weights[((size_t(c) * k + dy) * k + dx) * in.channels + ic];
              }
            }
            if (layer.relu) value = std::max(value, 0.0);
          } else if (layer.op == LayerOp::kMaxPool2) {
            value = std::max({at(2 * y, 2 * x, c), at(2 * y, 2 * x + 1, c), at(2 * y + 1, 2 * x, c),
                              at(2 * y + 1, 2 * x + 1, c)});
          } else if (layer.op == LayerOp::kUpsample2) {
            // Half-pixel centres: a quarter and three quarters of the two nearest, clamped at the
            // edge.
            const auto tap = [&](int out_at, int& low, int& high, double& weight) {
              const double source = (out_at + 0.5) / 2 - 0.5;
              low = static_cast<int>(std::floor(source));
              weight = source - low;
              high = std::min(low + 1, size - 1);
              low = std::max(low, 0);
            };
            int v0, v1, u0, u1;
            double wv, wu;
            tap(y, v0, v1, wv);
            tap(x, u0, u1, wu);
            value = (1 - wv) * ((1 - wu) * at(v0, u0, c) + wu * at(v0, u1, c)) +
                    wv * ((1 - wu) * at(v1, u0, c) + wu * at(v1, u1, c));
          } else if (c < in.channels) {
            value = at(y, x, c);
          } else {
            value = values[layer.inputs[1]]
                          [(size_t(y) * shape.size + x) * shapes[layer.inputs[1]].channels +
                           (c - in.channels)];
          }
          out[(size_t(y) * shape.size + x) * shape.channels + c] = value;
        }
      }
    }
    values.push_back(std::move(out));
  }
  return values.back();
}

TEST(PoseUNet, HasThePapersParameterCountsAndTokenLengths) {
  const auto count = [](uint32_t size, uint32_t input, uint32_t channels, uint32_t degree) {
    return PoseUNet(make_pose_unet(size, input, channels, head_channels(degree)), {})
        .parameter_count();
  };
  EXPECT_EQ(count(256, 6, 64, 3), 598'011u);   // paper
  EXPECT_EQ(count(128, 6, 32, 0), 150'094u);   // edge
  EXPECT_EQ(count(32, 6, 8, 0), 9'886u);       // nano
  EXPECT_EQ(count(128, 26, 32, 0), 155'854u);  // with five Fourier octaves
  EXPECT_EQ(count(32, 26, 8, 0), 11'326u);
  const std::vector<uint64_t> paper =
      PoseUNet(make_pose_unet(256, 6, 64, head_channels(3)), {}).token_lengths();
  const uint64_t same = 64 * 64 * 9 + 64, doubled = 128 * 64 * 9 + 64;
  EXPECT_EQ(paper,
            (std::vector<uint64_t>{6 * 64 * 9 + 64, same, same, same, same, same, same, same,
                                   doubled, same, doubled, same, doubled, same, 64 * 59 + 59}));
  EXPECT_EQ(*std::max_element(paper.begin(), paper.end()), 73'792u);
}

TEST(PoseUNet, ForwardEqualsTheDefinitionOfTheNetwork) {
  for (uint32_t size : {16u, 32u}) {
    PoseUNet unet(make_pose_unet(size, 6, 8, head_channels(0)),
                  {.precision = Precision::kFloat32, .seed = 3, .head_weight_factor = 1});
    const torch::Tensor input = random_tensor({size, size, 6}, 4);
    const torch::Tensor head = unet.forward(input);
    ASSERT_EQ(head.sizes(), torch::IntArrayRef({size, size, 14}));
    std::vector<float> storage;
    const std::vector<double> truth = evaluate(unet.export_network(storage), to_double(input)),
                              seen = to_double(head);
    double largest = 0;
    for (size_t i = 0; i < truth.size(); ++i)
      largest = std::max(largest, std::abs(truth[i] - seen[i]));
    std::printf("T = %u: largest error %.3g\n", size, largest);
    EXPECT_LT(largest, 2e-5);
  }
}

TEST(PoseUNet, GradientsEqualFiniteDifferencesOfTheDefinition) {
  PoseUNet unet(make_pose_unet(16, 6, 4, head_channels(0)),
                {.precision = Precision::kFloat32, .seed = 5, .head_weight_factor = 1});
  const torch::Tensor input = random_tensor({16, 16, 6}, 6),
                      weights = random_tensor({16, 16, 14}, 7);
  unet.forward(input).backward(weights);
  const std::vector<double> gradient = to_double(unet.gradients()), by_output = to_double(weights),
                            wide_input = to_double(input);
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  const auto loss = [&] {
    const std::vector<double> out = evaluate(network, wide_input);
    double sum = 0;
    for (size_t i = 0; i < out.size(); ++i) sum += by_output[i] * out[i];
    return sum;
  };
  double scale = 0, largest = 0;
  for (double value : gradient) scale += value * value / static_cast<double>(gradient.size());
  scale = std::sqrt(scale);
  int kinks = 0, checked = 0;
  for (size_t i = 0; i < storage.size(); i += 13, ++checked) {
    const float kept = storage[i];
    const auto difference = [&](float h) {
      storage[i] = kept + h;
      const double up = loss(), above = storage[i];
      storage[i] = kept - h;
      const double down = loss(), below = storage[i];
      storage[i] = kept;
      return (up - down) / (above - below);
    };
    // A ReLU's or pool's kink inside the step shows as two steps that disagree; such a value says
    // nothing.
    const double coarse = difference(1e-4f), fine = difference(1e-5f);
    if (std::abs(coarse - fine) > 1e-3 * (std::abs(fine) + scale)) {
      ++kinks;
      continue;
    }
    largest = std::max(largest, std::abs(gradient[i] - fine) / (std::abs(fine) + scale));
  }
  std::printf("%d of %d values on a kink, largest relative error of the others %.3g\n", kinks,
              checked, largest);
  EXPECT_LT(largest, 2e-3);
  EXPECT_LT(kinks, checked / 5);
}

TEST(PoseUNet, Bfloat16StaysCloseToFloat) {
  const Network network = make_pose_unet(64, 26, 16, head_channels(0));
  PoseUNet exact(network, {.precision = Precision::kFloat32, .seed = 8}),
      fast(network, {.precision = Precision::kBfloat16, .seed = 8});
  const torch::Tensor input = random_tensor({64, 64, 26}, 9),
                      weights = random_tensor({64, 64, 14}, 10);
  const torch::Tensor exact_head = exact.forward(input), fast_head = fast.forward(input);
  exact_head.backward(weights);
  fast_head.backward(weights);
  torch::NoGradGuard guard;
  const double head = ((exact_head - fast_head).norm() / exact_head.norm()).item<double>();
  const double cosine = (torch::dot(exact.gradients(), fast.gradients()) /
                         (exact.gradients().norm() * fast.gradients().norm()))
                            .item<double>();
  std::printf("relative RMS of the head %.3g, cosine of the gradients %.5f\n", head, cosine);
  // Eight bits of mantissa: 0.2 to 0.4 % a value. Gradients of a random picture are sums that
  // nearly cancel, so their direction is what can be asked for.
  EXPECT_LT(head, 0.02);
  EXPECT_GT(cosine, 0.99);
}

TEST(PoseUNet, TheSameSeedGivesTheSameWeightsOnEveryMachine) {
  const Network network = make_pose_unet(32, 26, 8, head_channels(0));
  PoseUNet a(network, {.seed = 1}), b(network, {.seed = 1}), c(network, {.seed = 2});
  EXPECT_TRUE(torch::equal(a.weights(), b.weights()));
  EXPECT_FALSE(torch::equal(a.weights(), c.weights()));
  // The first two draws of SplitMix64(1), 0x910a2dec89025cc1 and 0xbeeb8da1658eec67, as 24-bit
  // integers around zero, times sqrt(6 / 234).
  const float bound = std::sqrt(6.0f / 234.0f);
  EXPECT_EQ(a.weights()[0].item<float>(),
            bound * (static_cast<float>(0x910a2d - 0x800000) * 0x1p-23f));
  EXPECT_EQ(a.weights()[1].item<float>(),
            bound * (static_cast<float>(0xbeeb8d - 0x800000) * 0x1p-23f));
}

TEST(PoseUNet, InitialBiasesAreZeroButTheColours) {
  PoseUNet unet(make_pose_unet(32, 6, 8, head_channels(1)), {.rgb_bias = 0.3f});
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  for (const Layer& layer : network.layers) {
    for (size_t i = 0; i < layer.bias.size(); ++i) {
      const bool colour = &layer == &network.layers.back() && i >= 11 && i < 14;
      ASSERT_EQ(layer.bias[i], colour ? 0.3f : 0.0f);
    }
  }
}

TEST(PoseUNet, ExportedWeightsComeBack) {
  const Network network = make_pose_unet(32, 6, 8, head_channels(0));
  PoseUNet a(network, {.seed = 1}), b(network, {.seed = 2});
  std::vector<float> storage;
  b.import_network(a.export_network(storage));
  EXPECT_TRUE(torch::equal(a.weights(), b.weights()));
  PoseUNet other(make_pose_unet(32, 6, 4, head_channels(0)), {});
  EXPECT_THROW(other.import_network(a.export_network(storage)), InputError);
}

TEST(PoseUNet, BackwardPassesAddUp) {
  PoseUNet unet(make_pose_unet(16, 6, 4, head_channels(0)),
                {.precision = Precision::kFloat32, .seed = 1});
  const torch::Tensor input = random_tensor({16, 16, 6}, 1),
                      weights = random_tensor({16, 16, 14}, 2);
  unet.forward(input).backward(weights);
  const torch::Tensor once = unet.gradients().clone();
  unet.forward(input).backward(weights);
  EXPECT_TRUE(torch::allclose(unet.gradients(), 2 * once));
  unet.zero_gradients();
  EXPECT_FALSE(unet.gradients().defined());
}

TEST(Optimiser, AdamWEqualsItsEquations) {
  constexpr int64_t kCount = 37;
  const OptimiserOptions options{.weight_decay = 0.05};
  Optimiser adamw(adamw_group(kCount), options);
  torch::Tensor weights = random_tensor({kCount}, 1);
  std::vector<double> w = to_double(weights), m(kCount), v(kCount);
  double largest = 0;
  for (int step = 1; step <= 20; ++step) {
    const torch::Tensor gradients = random_tensor({kCount}, 100 + step);
    ASSERT_TRUE(adamw.step(weights, gradients, 1e-2));
    for (int64_t i = 0; i < kCount; ++i) {
      const double g = gradients[i].item<float>();
      m[i] = 0.9 * m[i] + 0.1 * g;
      v[i] = 0.999 * v[i] + 0.001 * g * g;
      w[i] -= 1e-2 * (m[i] / (1 - std::pow(0.9, step)) /
                          (std::sqrt(v[i] / (1 - std::pow(0.999, step))) + options.epsilon) +
                      0.05 * w[i]);
      largest = std::max(largest, std::abs(w[i] - weights[i].item<float>()));
    }
  }
  std::printf("largest error %.3g\n", largest);
  EXPECT_LT(largest, 20 * 0x1p-22);  // twenty steps, each rounds a weight below 4
}

// Newton-Schulz as it is written, on the whole matrix in double.
torch::Tensor newton_schulz(const torch::Tensor& matrix) {
  torch::Tensor x = matrix.to(torch::kDouble) / matrix.to(torch::kDouble).norm();
  for (int i = 0; i < 5; ++i) {
    const torch::Tensor gram = at::mm(x, x.t());
    x = x * 3.4445 + at::mm(gram * -4.7750 + at::mm(gram, gram) * 2.0315, x);
  }
  return x;
}

TEST(Muon, OrthogonalisesAsWrittenOnTheWholeMatrix) {
  double largest = 0;
  for (const auto& [rows, columns] :
       {std::pair<int64_t, int64_t>{32, 288}, {8, 8}, {64, 54}, {1, 9}}) {
    const torch::Tensor matrix = random_tensor({rows, columns}, 7) * 1e-6f;
    const double error =
        (orthogonalised(matrix) - newton_schulz(matrix)).abs().max().item<double>();
    largest = std::max(largest, error);
  }
  std::printf("largest error %.3g\n", largest);
  EXPECT_LT(largest, 1e-5);  // the last product is in float, of up to 64 terms below 2
}

// A step of equal length along every direction: singular values from a five hundredth of the norm
// up come out near 1, however unequal.
TEST(Muon, MakesSingularValuesEqual) {
  const torch::Tensor u = std::get<0>(at::linalg_qr(random_tensor({32, 32}, 1).to(torch::kDouble))),
                      v = std::get<0>(
                          at::linalg_qr(random_tensor({288, 32}, 2).to(torch::kDouble)));
  torch::Tensor singular = torch::logspace(0, -2.5, 32, 10.0, torch::kDouble);
  const torch::Tensor matrix = at::mm(u * singular, v.t()).to(torch::kFloat);
  const torch::Tensor found = at::linalg_svdvals(orthogonalised(matrix).to(torch::kDouble));
  const double least = found.min().item<double>(), most = found.max().item<double>();
  std::printf("singular values %.3f to %.3f of 1 to 0.003\n", least, most);
  EXPECT_GT(least, 0.65);
  EXPECT_LT(most, 1.25);
}

TEST(Muon, StaysFiniteAtTheEnds) {
  EXPECT_TRUE(torch::equal(orthogonalised(torch::zeros({4, 9})), torch::zeros({4, 9})));
  for (const float scale : {1e-43f, 1e-38f, 1e-20f, 1e20f, 1e37f}) {
    torch::Tensor matrix = random_tensor({8, 72}, 3) * scale;
    EXPECT_TRUE(torch::isfinite(orthogonalised(matrix)).all().item<bool>()) << scale;
    matrix = torch::zeros({8, 72});
    matrix[3][5] = scale;  // rank 1
    const float only = orthogonalised(matrix)[3][5].item<float>();
    EXPECT_GT(only, 0.65f) << scale;
    EXPECT_LT(only, 1.25f) << scale;
  }
}

TEST(Optimiser, MuonMovesAKernelByItsEquationsAndLeavesTheRestToAdamW) {
  PoseUNet unet(make_pose_unet(16, 6, 4, head_channels(0)),
                {.precision = Precision::kFloat32, .seed = 1});
  const std::vector<ParameterGroup> groups = unet.muon_groups();
  ASSERT_EQ(groups.size(), 30u);  // kernel and bias of 15 convolutions
  EXPECT_EQ(groups.back().end, static_cast<int64_t>(unet.parameter_count()));
  EXPECT_EQ(groups[28].matrix_rows, 0) << "the head";
  const OptimiserOptions options{.weight_decay = 0.1};
  Optimiser muon(groups, options), adamw(adamw_group(unet.parameter_count()), options);
  torch::Tensor weights = unet.weights().detach().clone(), other = weights.clone();
  const ParameterGroup& kernel = groups[2];
  const auto matrix = [&](const torch::Tensor& flat) {
    return flat.narrow(0, kernel.begin, kernel.end - kernel.begin)
        .view({kernel.matrix_rows, -1})
        .to(torch::kDouble);
  };
  torch::Tensor expected = matrix(weights), mean = torch::zeros_like(expected);
  for (int step = 1; step <= 3; ++step) {
    const torch::Tensor gradients = random_tensor({weights.numel()}, 40 + step);
    ASSERT_TRUE(muon.step(weights, gradients, 1e-2));
    ASSERT_TRUE(adamw.step(other, gradients, 1e-2));
    mean = 0.95 * mean + 0.05 * matrix(gradients);
    const torch::Tensor direction = newton_schulz(0.95 * mean + 0.05 * matrix(gradients));
    expected = expected * (1 - 1e-2 * 0.1) -
               direction * (1e-2 * 0.2 * std::sqrt(static_cast<double>(expected.size(1))));
  }
  EXPECT_LT((matrix(weights) - expected).abs().max().item<double>(), 1e-6);
  for (const ParameterGroup& group : {groups[3], groups[28], groups[29]}) {
    EXPECT_TRUE(torch::equal(weights.narrow(0, group.begin, group.end - group.begin),
                             other.narrow(0, group.begin, group.end - group.begin)));
  }
}

// A layer that is dead has no gradient, and its momentum decays to nothing: it must not move on.
TEST(Optimiser, MuonStopsWhereThereIsNoGradient) {
  Optimiser muon({{0, 32, 4}}, {});
  torch::Tensor weights = random_tensor({32}, 1);
  ASSERT_TRUE(muon.step(weights, random_tensor({32}, 2), 1e-2));
  const torch::Tensor after = weights.clone();
  for (int step = 0; step < 2500; ++step) ASSERT_TRUE(muon.step(weights, torch::zeros({32}), 1e-2));
  EXPECT_TRUE(torch::equal(weights, after));
  ASSERT_TRUE(muon.step(weights, random_tensor({32}, 3) * 1e-30, 1e-2));
  EXPECT_TRUE(torch::isfinite(weights).all().item<bool>());
  EXPECT_FALSE(torch::equal(weights, after));
}

TEST(Optimiser, LeavesWeightsAloneWhenAGradientIsNotFinite) {
  Optimiser adamw(adamw_group(20), {});
  torch::Tensor weights = random_tensor({20}, 1), gradients = random_tensor({20}, 2);
  const torch::Tensor before = weights.clone();
  gradients[18] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(adamw.step(weights, gradients, 1e-2));
  gradients[18] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(adamw.step(weights, gradients, 1e-2));
  EXPECT_TRUE(torch::equal(before, weights));
  EXPECT_EQ(adamw.steps, 0);
}

// SSIM by its definition: an 11x11 window at every pixel, in double.
double brute_force_ssim(const std::vector<double>& x, const std::vector<double>& y, int channels,
                        int height, int width) {
  double window[11], norm = 0, sum = 0;
  for (int k = 0; k < 11; ++k) norm += window[k] = std::exp(-(k - 5) * (k - 5) / (2 * 1.5 * 1.5));
  for (int c = 0; c < channels; ++c) {
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
        for (int dv = -5; dv <= 5; ++dv) {
          for (int du = -5; du <= 5; ++du) {
            if (v + dv < 0 || v + dv >= height || u + du < 0 || u + du >= width) continue;
            const double weight = window[dv + 5] * window[du + 5] / (norm * norm);
            const size_t at = (size_t(c) * height + v + dv) * width + u + du;
            mx += weight * x[at], my += weight * y[at];
            xx += weight * x[at] * x[at], yy += weight * y[at] * y[at],
                xy += weight * x[at] * y[at];
          }
        }
        sum += (2 * mx * my + 1e-4) * (2 * (xy - mx * my) + 9e-4) /
               ((mx * mx + my * my + 1e-4) * (xx - mx * mx + yy - my * my + 9e-4));
      }
    }
  }
  return sum / (double(channels) * height * width);
}

struct TwoImages {
  int height = 0, width = 0;
  std::vector<double> x, y;
};

TwoImages two_images(int height, int width) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform;
  TwoImages images{height, width, {}, {}};
  for (int i = 0; i < 2 * height * width; ++i) {
    images.x.push_back(uniform(random));
    images.y.push_back(0.5 * images.x.back() + 0.5 * uniform(random));
  }
  return images;
}

TEST(Ssim, EqualsItsDefinition) {
  for (const auto& [height, width] : {std::pair{7, 9}, std::pair{40, 75}, std::pair{120, 66}}) {
    const TwoImages images = two_images(height, width);
    SsimScratch<double> scratch;
    const double seen =
        ssim<double>({images.x.data(), images.y.data(), 2, uint32_t(height), uint32_t(width)}, 2,
                     scratch, nullptr);
    const double truth = brute_force_ssim(images.x, images.y, 2, height, width);
    std::printf("%dx%d: %.12f, error %.3g\n", height, width, truth, std::abs(seen - truth));
    EXPECT_NEAR(seen, truth, 1e-12);
  }
}

TEST(Ssim, GradientEqualsFiniteDifferences) {
  TwoImages images = two_images(102, 70);  // more than one tile both ways
  SsimScratch<double> scratch;
  std::vector<double> gradient(images.x.size());
  const auto value = [&](double* out) {
    return ssim<double>({images.x.data(), images.y.data(), 2, 102, 70}, 2, scratch, out);
  };
  value(gradient.data());
  double largest = 0, scale = 0;
  for (double g : gradient) scale = std::max(scale, std::abs(g));
  for (size_t i = 0; i < gradient.size(); i += 61) {
    const double kept = images.x[i], h = 1e-4;
    images.x[i] = kept + h;
    const double up = value(nullptr);
    images.x[i] = kept - h;
    const double down = value(nullptr);
    images.x[i] = kept;
    largest = std::max(largest, std::abs((up - down) / (2 * h) - gradient[i]) /
                                    std::max(std::abs(gradient[i]), 0.01 * scale));
  }
  std::printf("largest relative error %.3g\n", largest);
  EXPECT_LT(largest, 1e-5);
}

TEST(Ssim, FloatEqualsDoubleForAnyNumberOfThreads) {
  const TwoImages images = two_images(150, 133);
  const std::vector<float> x(images.x.begin(), images.x.end()), y(images.y.begin(), images.y.end());
  SsimScratch<double> wide_scratch;
  std::vector<double> truth(x.size());
  const double wide =
      ssim<double>({images.x.data(), images.y.data(), 2, 150, 133}, 1, wide_scratch, truth.data());
  std::vector<float> first;
  for (uint32_t threads : {1u, 2u, 5u}) {
    SsimScratch<float> scratch;
    std::vector<float> gradient(x.size());
    EXPECT_NEAR((ssim<float>({x.data(), y.data(), 2, 150, 133}, threads, scratch, gradient.data())),
                wide, 1e-5);
    if (first.empty()) first = gradient;
    EXPECT_EQ(gradient, first);
  }
  double error = 0, size = 0;
  for (size_t i = 0; i < truth.size(); ++i)
    error += std::pow(truth[i] - double(first[i]), 2), size += truth[i] * truth[i];
  std::printf("relative RMS of the float gradient %.3g\n", std::sqrt(error / size));
  EXPECT_LT(std::sqrt(error / size), 1e-4);
}

TEST(ImageLoss, ValueAndGradientEqualTorchsOwnOperations) {
  constexpr int kHeight = 61, kWidth = 83;
  torch::Tensor image = torch::rand({4, kHeight, kWidth}).requires_grad_();
  const torch::Tensor target = torch::rand({4, kHeight, kWidth});
  const std::array<float, 3> background{0.5f, 0.2f, 0.9f};
  LossTerms terms;
  image_loss(image, target, background, {.threads = 2}, &terms).backward();

  torch::Tensor x = image.detach().to(torch::kDouble).requires_grad_();
  const torch::Tensor y = target.to(torch::kDouble),
                      behind = torch::tensor({0.5, double(0.2f), double(0.9f)}).view({3, 1, 1});
  const auto composed = [&](const torch::Tensor& t) {
    return t.slice(0, 0, 3) + (1 - t.slice(0, 3, 4)) * behind;
  };
  const torch::Tensor a = composed(x), b = composed(y);
  torch::Tensor window =
      torch::exp(-(torch::arange(11, torch::kDouble) - 5).pow(2) / (2 * 1.5 * 1.5));
  window = window / window.sum();
  const torch::Tensor kernel = torch::outer(window, window).expand({3, 1, 11, 11}).contiguous();
  const auto mean = [&](const torch::Tensor& t) {
    return at::conv2d(t.unsqueeze(0), kernel, {}, 1, 5, 1, 3);  // padding 5, 3 groups
  };
  const torch::Tensor ma = mean(a), mb = mean(b), va = mean(a * a) - ma * ma,
                      vb = mean(b * b) - mb * mb, cov = mean(a * b) - ma * mb;
  const torch::Tensor ssim_mean =
      ((2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4)))
          .mean();
  const torch::Tensor l1 = (a - b).abs().mean(), mask = (x[3] - y[3]).abs().mean(),
                      loss = l1 + 0.1 * (1 - ssim_mean) + 0.1 * mask;
  loss.backward();
  const double difference =
      (image.grad() - x.grad()).abs().max().item<double>() / x.grad().abs().max().item<double>();
  std::printf("loss %.7f against %.7f, gradient's largest error %.3g of its largest value\n",
              double(terms.total), loss.item<double>(), difference);
  EXPECT_NEAR(terms.l1, l1.item<double>(), 1e-6);
  EXPECT_NEAR(terms.ssim, ssim_mean.item<double>(), 1e-5);
  EXPECT_NEAR(terms.mask, mask.item<double>(), 1e-6);
  EXPECT_NEAR(terms.total, loss.item<double>(), 1e-5);
  EXPECT_LT(difference, 1e-4);
  const torch::Tensor inside = (y[3] > 0.5).to(torch::kDouble);
  EXPECT_EQ(terms.foreground, inside.sum().item<int64_t>());
  EXPECT_NEAR(terms.squared_error, ((a - b).pow(2) * inside).sum().item<double>(), 1e-2);
}

// (sum of w (seen - truth))^2 with w = 1, 2, 3, ...: every value has a gradient of its own.
class WeightedSum : public PictureDistance {
 public:
  uint32_t least_side_px() const override { return 5; }
  torch::Tensor between(const torch::Tensor& seen, const torch::Tensor& truth) const override {
    return (weights(seen) * (seen - truth)).sum().square();
  }
  static torch::Tensor weights(const torch::Tensor& like) {
    return (1 + torch::arange(like.numel(), torch::kFloat)).view(like.sizes()) * 1e-3f;
  }
};

TEST(PerceptualLoss, LooksAtItsWindowThroughTheBackground) {
  torch::Tensor image = torch::rand({4, 20, 30}).requires_grad_();
  const torch::Tensor target = torch::rand({4, 20, 30});
  const std::array<float, 3> background{0.5f, 0.2f, 0.9f};
  const PixelRect window{.x = 7, .y = 4, .width = 6, .height = 9};
  const torch::Tensor loss = perceptual_loss(image, target, background, window, WeightedSum());
  loss.backward();
  double sum = 0;
  const auto over = [&](const torch::Tensor& picture, int64_t c, int64_t y, int64_t x) {
    return picture[c][y][x].item<double>() +
           (1 - picture[3][y][x].item<double>()) * double(background[size_t(c)]);
  };
  for (int64_t c = 0; c < 3; ++c) {
    for (int64_t y = 0; y < 9; ++y) {
      for (int64_t x = 0; x < 6; ++x)
        sum += 1e-3 * double(1 + (c * 9 + y) * 6 + x) *
               (over(image, c, 4 + y, 7 + x) - over(target, c, 4 + y, 7 + x));
    }
  }
  EXPECT_NEAR(loss.item<double>(), sum * sum, 1e-4 * sum * sum);
  const torch::Tensor gradient = image.grad();
  using Corner = std::array<int64_t, 2>;
  for (const auto [y, x] : {Corner{0, 0}, Corner{8, 5}}) {
    double by_alpha = 0;
    for (int64_t c = 0; c < 3; ++c) {
      const double expected = 2 * sum * 1e-3 * double(1 + (c * 9 + y) * 6 + x);
      EXPECT_NEAR(gradient[c][4 + y][7 + x].item<double>(), expected, 1e-4 * std::abs(expected));
      by_alpha -= expected * double(background[size_t(c)]);
    }
    EXPECT_NEAR(gradient[3][4 + y][7 + x].item<double>(), by_alpha, 1e-4 * std::abs(by_alpha));
  }
  torch::Tensor outside = gradient.detach().clone();
  outside.narrow(1, 4, 9).narrow(2, 7, 6).zero_();
  EXPECT_EQ(outside.abs().max().item<float>(), 0);
  const torch::Tensor small = perceptual_loss(
      image, target, background, {.x = 0, .y = 0, .width = 9, .height = 4}, WeightedSum());
  EXPECT_EQ(small.item<float>(), 0);
  EXPECT_FALSE(small.requires_grad());
}

}  // namespace
}  // namespace figurine::model::model_test
