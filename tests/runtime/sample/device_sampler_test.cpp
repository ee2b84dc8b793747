// The device's sampler, part by part and whole: exact integer products, the transformer against its
// equations in double, weights, seeds, blends of two seeds, the trace, and the bits that every CPU
// must have.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "figurine/package.h"
#include "formats/package_samples.h"
#include "runtime/sample/random_sampler.h"
#include "runtime/src/sample/device_transformer.h"
#include "runtime/src/sample/integer_linear.h"
#include "runtime/src/sample/weight_decoder.h"

namespace figurine::device_sampler_test {
namespace {

using tests::RandomSampler;

// ---- Integer products ---------------------------------------------------------------------------

std::vector<float> normal(uint64_t stream, size_t count) {
  std::vector<float> values(count);
  fill_normal(3, stream, values);
  return values;
}

TEST(IntegerLinear, StepsAreAsLargeAsNoSumOverflows) {
  EXPECT_EQ(largest_step(1), 32767);
  for (const size_t columns : {1u, 8u, 512u, 516u, 517u, 1024u, 4096u}) {
    const int64_t step = largest_step(columns);
    EXPECT_LE(127 * step * int64_t(columns), std::numeric_limits<int32_t>::max()) << columns;
    if (step < 32767) {
      EXPECT_GT(127 * (step + 1) * int64_t(columns), std::numeric_limits<int32_t>::max())
          << columns;
    }
  }
  EXPECT_GE(largest_step(kMaxDenoiserWidth),
            4096);  // 12 bits at the widest that a package may have
}

// Largest difference to the product in double, in units of the rounding that the header states.
TEST(IntegerLinear, IsTheProductButForTheRoundingOfItsInput) {
  for (const auto& [rows, columns, outputs] : std::vector<std::array<size_t, 3>>{
           {1, 1, 1}, {3, 7, 5}, {4, 8, 4}, {17, 256, 33}, {5, 1023, 9}, {2, 4096, 3}}) {
    const std::vector<float> x = normal(rows * columns, rows * columns),
                             scales = normal(5, outputs), bias = normal(6, outputs);
    std::vector<float> row_scale;
    for (const float scale : scales) row_scale.push_back(1e-3f + std::fabs(scale));
    std::vector<int8_t> matrix(outputs * columns);
    for (size_t k = 0; k < matrix.size(); ++k)
      matrix[k] = static_cast<int8_t>(static_cast<int>(k * 73 % 255) - 127);
    RoundedRows rounded;
    ASSERT_TRUE(rounded.ensure(rows, columns));
    rounded.round(x.data(), rows, columns, columns);
    std::vector<float> y(rows * outputs);
    std::vector<int16_t> storage(rounded.length() + 8);
    auto* aligned =
        reinterpret_cast<int16_t*>((reinterpret_cast<uintptr_t>(storage.data()) + 15) / 16 * 16);
    multiply(best_kernels(), {matrix, row_scale, bias}, rounded, {aligned, rounded.length()},
             y.data(), outputs);
    for (size_t m = 0; m < rows; ++m) {
      float largest = 0;
      for (size_t k = 0; k < columns; ++k)
        largest = std::max(largest, std::fabs(x[m * columns + k]));
      for (size_t n = 0; n < outputs; ++n) {
        double sum = 0, magnitudes = 0;
        for (size_t k = 0; k < columns; ++k) {
          sum += double(matrix[n * columns + k]) * x[m * columns + k];
          magnitudes += std::abs(double(matrix[n * columns + k]));
        }
        const double truth = sum * row_scale[n] + bias[n];
        const double step = double(largest) / largest_step(columns);
        const double bound =
            (0.51 * step * magnitudes + 1e-6 * std::fabs(sum)) * row_scale[n] + 1e-6;
        EXPECT_NEAR(y[m * outputs + n], truth, bound)
            << rows << "x" << columns << " to " << outputs;
      }
    }
  }
}

TEST(IntegerLinear, TheLargestSumsAreExact) {
  constexpr size_t kColumns = 4096;
  const std::vector<float> x(kColumns, 2.0f), row_scale(1, 1.0f), bias(1, 0.0f);
  const std::vector<int8_t> matrix(kColumns, 127);
  RoundedRows rounded;
  ASSERT_TRUE(rounded.ensure(1, kColumns));
  rounded.round(x.data(), 1, kColumns, kColumns);
  alignas(16) int16_t row[kColumns];
  float y = 0;
  multiply(best_kernels(), {matrix, row_scale, bias}, rounded, row, &y, 1);
  EXPECT_NEAR(y, 127.0 * kColumns * 2, 127.0 * kColumns * 2 * 1e-6);
}

TEST(IntegerLinear, RowsOfZerosAndOfTinyValuesAreZero) {
  const std::vector<float> x = {
      0, 0, 0, 1e-35f, -1e-36f, 0, std::numeric_limits<float>::denorm_min(), 0, 0};
  const std::vector<float> row_scale(1, 1.0f), bias(1, 0.25f);
  const std::vector<int8_t> matrix = {127, -127, 1};
  RoundedRows rounded;
  ASSERT_TRUE(rounded.ensure(3, 3));
  rounded.round(x.data(), 3, 3, 3);
  alignas(16) int16_t row[8];
  float y[3];
  multiply(best_kernels(), {matrix, row_scale, bias}, rounded, row, y, 1);
  for (const float value : y) EXPECT_EQ(value, 0.25f);
}

// ---- The transformer ----------------------------------------------------------------------------

// The equations of toolchain/generate/transformer.h in double, with the package's integers as real
// matrices.
class TransformerInDouble {
 public:
  explicit TransformerInDouble(const Sampler& sampler) : s_(sampler), d_(sampler.denoiser.d_model) {
    for (const MatrixShape& shape : denoiser_matrices(s_.denoiser, s_.ranks)) {
      shapes_.push_back(shape);
      begin_.push_back(begin_.empty() ? 0 : begin_.back() + values_before_);
      row_begin_.push_back(row_begin_.empty() ? 0 : row_begin_.back() + rows_before_);
      values_before_ = size_t{shape.rows} * shape.columns, rows_before_ = shape.rows;
    }
  }

  std::vector<double> predict(const std::vector<float>& z, double lambda) const {
    const size_t tokens = s_.ranks.size() + 1;
    std::vector<std::vector<double>> t;
    std::vector<double> wave(d_);
    for (size_t k = 0; k < d_ / 2; ++k) {
      const double angle = lambda * 0.05 * std::pow(400.0, double(k) / double(d_ / 2 - 1));
      wave[k] = std::sin(angle), wave[d_ / 2 + k] = std::cos(angle);
    }
    std::vector<double> hidden = linear(s_.ranks.size(), wave);
    for (double& h : hidden) h /= 1 + std::exp(-h);
    t.push_back(linear(s_.ranks.size() + 1, hidden));
    size_t at = 0;
    for (size_t l = 0; l < s_.ranks.size(); at += s_.ranks[l++]) {
      t.push_back(linear(l, std::vector<double>(z.begin() + ptrdiff_t(at),
                                                z.begin() + ptrdiff_t(at + s_.ranks[l]))));
    }
    for (size_t i = 0; i < tokens; ++i) {
      for (size_t k = 0; k < d_; ++k) t[i][k] += s_.position[i * d_ + k];
    }
    size_t matrix = s_.ranks.size() + 2;
    for (size_t b = 0; b < s_.denoiser.blocks; ++b, matrix += 4) {
      std::vector<std::vector<double>> qkv;
      for (const auto& token : t) qkv.push_back(linear(matrix, norm(2 * b, token)));
      const std::vector<std::vector<double>> attended = attention(qkv);
      for (size_t i = 0; i < tokens; ++i) add(t[i], linear(matrix + 1, attended[i]));
      for (auto& token : t) {
        std::vector<double> inner = linear(matrix + 2, norm(2 * b + 1, token));
        for (double& h : inner) h *= 0.5 * (1 + std::erf(h / std::sqrt(2.0)));
        add(token, linear(matrix + 3, inner));
      }
    }
    std::vector<double> out;
    for (size_t l = 0; l < s_.ranks.size(); ++l) {
      const std::vector<double> values =
          linear(matrix + l, norm(2 * size_t{s_.denoiser.blocks}, t[l + 1]));
      out.insert(out.end(), values.begin(), values.end());
    }
    return out;
  }

 private:
  static void add(std::vector<double>& to, const std::vector<double>& what) {
    for (size_t k = 0; k < to.size(); ++k) to[k] += what[k];
  }

  std::vector<double> linear(size_t matrix, const std::vector<double>& x) const {
    const auto [rows, columns] = shapes_[matrix];
    std::vector<double> y(rows);
    for (size_t n = 0; n < rows; ++n) {
      for (size_t k = 0; k < columns; ++k)
        y[n] += double(s_.matrices[begin_[matrix] + n * columns + k]) * x[k];
      y[n] = y[n] * s_.row_scale[row_begin_[matrix] + n] + s_.bias[row_begin_[matrix] + n];
    }
    return y;
  }

  std::vector<double> norm(size_t which, const std::vector<double>& x) const {
    double mean = 0, variance = 0;
    for (const double value : x) mean += value / double(d_);
    for (const double value : x) variance += (value - mean) * (value - mean) / double(d_);
    std::vector<double> y(d_);
    const float* weight = s_.norm.data() + which * 2 * d_;
    for (size_t k = 0; k < d_; ++k)
      y[k] = (x[k] - mean) / std::sqrt(variance + 1e-5) * weight[k] + weight[d_ + k];
    return y;
  }

  std::vector<std::vector<double>> attention(const std::vector<std::vector<double>>& qkv) const {
    const size_t heads = s_.denoiser.heads, size = d_ / heads;
    std::vector<std::vector<double>> out(qkv.size(), std::vector<double>(d_));
    for (size_t h = 0; h < heads; ++h) {
      for (size_t i = 0; i < qkv.size(); ++i) {
        std::vector<double> weight(qkv.size());
        double sum = 0;
        for (size_t j = 0; j < qkv.size(); ++j) {
          double score = 0;
          for (size_t c = 0; c < size; ++c)
            score += qkv[i][h * size + c] * qkv[j][d_ + h * size + c];
          sum += weight[j] = std::exp(score / std::sqrt(double(size)));
        }
        for (size_t j = 0; j < qkv.size(); ++j) {
          for (size_t c = 0; c < size; ++c)
            out[i][h * size + c] += weight[j] / sum * qkv[j][2 * d_ + h * size + c];
        }
      }
    }
    return out;
  }

  const Sampler& s_;
  size_t d_, values_before_ = 0, rows_before_ = 0;
  std::vector<MatrixShape> shapes_;
  std::vector<size_t> begin_, row_begin_;
};

TEST(DeviceTransformer, IsItsEquationsButForTheRoundingOfActivations) {
  tests::RandomSamplerShape shapes[3];
  shapes[1] = {.rank = 1,
               .shape_count = 0,
               .denoiser = {.d_model = 8, .blocks = 1, .heads = 1, .feed_forward = 3}};
  shapes[2] = {.rank = 13,
               .denoiser = {.d_model = 96, .blocks = 4, .heads = 16, .feed_forward = 200},
               .contrast = 2};
  for (const tests::RandomSamplerShape& shape : shapes) {
    const RandomSampler sampler(shape);
    const auto transformer = DeviceTransformer::create(sampler.view);
    ASSERT_TRUE(transformer.ok()) << transformer.status().message();
    const TransformerInDouble reference(sampler.view);
    const size_t size = sampler.direction_scale.size();
    std::vector<float> x0(size);
    for (const double lambda : {-7.5, -1.0, 0.0, 4.6}) {
      const std::vector<float> z = normal(11, size);
      (*transformer)->predict(z, lambda, x0);
      const std::vector<double> truth = reference.predict(z, lambda);
      double error = 0, power = 0;
      for (size_t k = 0; k < size; ++k) {
        error += (x0[k] - truth[k]) * (x0[k] - truth[k]);
        power += truth[k] * truth[k];
      }
      std::printf("  d %u, lambda %g: relative error %.2g\n", shape.denoiser.d_model, lambda,
                  std::sqrt(error / power));
      EXPECT_LT(std::sqrt(error / power), 5e-4);
    }
  }
}

TEST(DeviceTransformer, HoldsItsValuesWhereInputsAreExtreme) {
  const RandomSampler sampler;
  const auto transformer = DeviceTransformer::create(sampler.view);
  ASSERT_TRUE(transformer.ok());
  const size_t size = sampler.direction_scale.size();
  std::vector<float> x0(size);
  for (const float value : {0.0f, 1e-30f, 6.77f, 1e10f, -1e30f}) {
    (*transformer)->predict(std::vector<float>(size, value), 0, x0);
    for (const float x : x0) ASSERT_TRUE(std::isfinite(x)) << value;
  }
}

// ---- Weights ------------------------------------------------------------------------------------

TEST(WeightDecoder, IsTheStatedArithmetic) {
  const RandomSampler sampler;
  const Sampler& view = sampler.view;
  const std::vector<float> from = normal(2, view.direction_scale.size());
  std::vector<float> weights(view.mean.size());
  decode_weights(view, std::vector<double>(from.begin(), from.end()), weights);
  const std::vector<size_t> sizes = sampler_token_sizes(view);
  size_t begin = 0, value = 0, direction = 0;
  for (size_t l = 0; l < sizes.size(); ++l) {
    for (const size_t j : {size_t{0}, sizes[l] / 2, sizes[l] - 1}) {
      double truth = view.mean[begin + j];
      for (uint32_t k = 0; k < view.ranks[l]; ++k) {
        truth += double(from[value + k]) * view.direction_scale[value + k] *
                 view.directions[direction + k * sizes[l] + j];
      }
      EXPECT_NEAR(weights[begin + j], truth, 1e-6) << "token " << l << ", value " << j;
    }
    begin += sizes[l], value += view.ranks[l], direction += view.ranks[l] * sizes[l];
  }
}

// ---- Seeds --------------------------------------------------------------------------------------

std::vector<float> weights_of(const SampledAvatar& sampled) {
  std::vector<float> weights;
  for (const Layer& layer : sampled.avatar().network.layers) {
    weights.insert(weights.end(), layer.weights.begin(), layer.weights.end());
    weights.insert(weights.end(), layer.bias.begin(), layer.bias.end());
  }
  weights.insert(weights.end(), sampled.avatar().shape.begin(), sampled.avatar().shape.end());
  return weights;
}

class AvatarSamplerTest : public testing::Test {
 protected:
  AvatarSamplerTest() {
    auto created = AvatarSampler::create(random_.view);
    EXPECT_TRUE(created.ok()) << created.status().message();
    sampler_ = std::move(*created);
  }

  std::array<uint64_t, 2> hash_of(const SampleRequest& request) {
    SampledAvatar person;
    const Status status = sampler_->sample(request, person);
    EXPECT_TRUE(status.ok()) << status.message();
    return hash_weights(person.avatar().fixed_point, person.avatar().shape,
                        person.avatar().static_part);
  }

  RandomSampler random_;
  std::unique_ptr<AvatarSampler> sampler_;
};

TEST_F(AvatarSamplerTest, MakesASoundAvatarOfTheSamplersShape) {
  SampledAvatar person;
  ASSERT_TRUE(sampler_->sample({.seed = 1}, person).ok());
  const Avatar& avatar = person.avatar();
  EXPECT_TRUE(infer_shapes(avatar.network, true).ok());
  EXPECT_TRUE(validate_fixed_point(avatar.network, avatar.fixed_point).ok());
  EXPECT_EQ(avatar.shape.size(), 3u);
  EXPECT_EQ(weights_of(person).size(), random_.mean.size());
}

TEST_F(AvatarSamplerTest, ASeedIsOneAvatarAndAnotherIsAnother) {
  const auto first = hash_of({.seed = 1});
  EXPECT_EQ(first, hash_of({.seed = 1}));
  EXPECT_NE(first, hash_of({.seed = 2}));
  EXPECT_NE(first, hash_of({.seed = uint64_t{1} << 40}));
  EXPECT_NE(first, hash_of({.seed = 1, .steps = 7}));
  EXPECT_NE(first, hash_of({.seed = 1, .method = SolverMethod::kDdim}));
}

TEST_F(AvatarSamplerTest, AnInstructionSetIsChosenOrRefused) {
  const auto expected = hash_of({.seed = 1});
  EXPECT_EQ(sampler_->isa(), supported_isas().back());
  for (const Isa isa : {Isa::kBaseline, Isa::kNeon, Isa::kSse41, Isa::kAvx2, Isa::kAvx512}) {
    const std::span<const Isa> supported = supported_isas();
    auto created = AvatarSampler::create(random_.view, isa);
    if (std::find(supported.begin(), supported.end(), isa) == supported.end()) {
      EXPECT_EQ(created.status().code(), StatusCode::kUnsupported) << to_string(isa);
      continue;
    }
    ASSERT_TRUE(created.ok()) << created.status().message();
    EXPECT_EQ((*created)->isa(), isa);
    sampler_ = std::move(*created);
    EXPECT_EQ(hash_of({.seed = 1}), expected) << to_string(isa);
  }
}

TEST_F(AvatarSamplerTest, ZeroStepsAndNoMethodAreThePackages) {
  EXPECT_EQ(hash_of({.seed = 1}),
            hash_of({.seed = 1, .steps = 20, .method = SolverMethod::kDpmSolverPlusPlus2M}));
}

TEST_F(AvatarSamplerTest, BlendsBeginAndEndAtTheSeeds) {
  EXPECT_EQ(hash_of({.seed = 1, .to = 2, .mix = 0}), hash_of({.seed = 1}));
  EXPECT_EQ(hash_of({.seed = 1, .to = 2, .mix = 1}), hash_of({.seed = 2}));
  const auto middle = hash_of({.seed = 1, .to = 2, .mix = 0.5});
  EXPECT_NE(middle, hash_of({.seed = 1}));
  EXPECT_NE(middle, hash_of({.seed = 2}));
}

TEST_F(AvatarSamplerTest, BlendsAreContinuous) {
  SampledAvatar a, b;
  ASSERT_TRUE(sampler_->sample({.seed = 1, .to = 2, .mix = 0.5}, a).ok());
  ASSERT_TRUE(sampler_->sample({.seed = 1, .to = 2, .mix = 0.5001}, b).ok());
  const std::vector<float> first = weights_of(a), second = weights_of(b);
  float largest = 0;
  for (size_t k = 0; k < first.size(); ++k)
    largest = std::max(largest, std::fabs(first[k] - second[k]));
  EXPECT_LT(largest, 0.02f);
}

TEST_F(AvatarSamplerTest, RefusesWhatIsOutOfRange) {
  SampledAvatar person;
  EXPECT_EQ(sampler_->sample({.seed = 1, .steps = 1001}, person).code(),
            StatusCode::kInvalidArgument);
  for (const double mix : {-0.1, 1.1, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(sampler_->sample({.seed = 1, .mix = mix}, person).code(),
              StatusCode::kInvalidArgument)
        << mix;
  }
}

TEST_F(AvatarSamplerTest, EveryNumberOfStepsIsFinite) {
  SampledAvatar person;
  for (const uint32_t steps : {1u, 2u, 3u, 5u, 50u, 250u}) {
    for (const SolverMethod method : {SolverMethod::kDdim, SolverMethod::kDpmSolverPlusPlus2M}) {
      ASSERT_TRUE(sampler_->sample({.seed = 4, .steps = steps, .method = method}, person).ok())
          << steps;
    }
  }
}

TEST_F(AvatarSamplerTest, ADenoiserThatIsNotFiniteIsRefused) {
  RandomSampler broken;
  std::fill(broken.row_scale.end() - 4, broken.row_scale.end(), 3e38f);
  std::fill(broken.bias.end() - 4, broken.bias.end(), std::numeric_limits<float>::infinity());
  const auto sampler = AvatarSampler::create(broken.view);
  ASSERT_TRUE(sampler.ok());
  SampledAvatar person;
  const Status status = (*sampler)->sample({.seed = 1}, person);
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("not finite"), std::string::npos) << status.message();
}

// Borrowed is what the package's bytes hold: neither the Package nor the description that it
// verified has to live on. Under a sanitizer a read of either is an error.
TEST(AvatarSampler, OutlivesThePackageThatItWasMadeFrom) {
  const AlignedBytes bytes(*samples::SamplerSample().write());
  SampledAvatar early, late;
  std::unique_ptr<AvatarSampler> sampler;
  {
    const Result<Package> package = Package::open(bytes.bytes(), "sample");
    ASSERT_TRUE(package.ok()) << package.status().message();
    auto created = AvatarSampler::create(package->sampler());
    ASSERT_TRUE(created.ok()) << created.status().message();
    sampler = std::move(*created);
    ASSERT_TRUE(sampler->sample({.seed = 3}, early).ok());
  }
  EXPECT_GT(sampler->macs_per_evaluation(), 0u);
  ASSERT_TRUE(sampler->sample({.seed = 3}, late).ok());
  sampler.reset();  // an avatar needs no sampler either
  for (const SampledAvatar* person : {&early, &late}) {
    const Avatar& avatar = person->avatar();
    EXPECT_TRUE(validate_fixed_point(avatar.network, avatar.fixed_point).ok());
    EXPECT_EQ(avatar.pose_statistics.covariance.size(),
              9 * avatar.pose_statistics.joints.size() * avatar.pose_statistics.joints.size());
    for (const float value : avatar.golden.rotations) EXPECT_TRUE(std::isfinite(value));
  }
  EXPECT_EQ(hash_weights(early.avatar().fixed_point, early.avatar().shape),
            hash_weights(late.avatar().fixed_point, late.avatar().shape));
}

// Every value says which cell, channel and group it is of; beyond the range it is clamped.
TEST(DecodeStaticPart, PutsCellsWhereTheirRowsSay) {
  const samples::StaticSamplerSample sample;
  const Sampler& sampler = sample.sampler;
  std::vector<float> patches;
  for (const SampledStaticGroup& group : sampler.static_groups) {
    for (const uint32_t row : group.row) {
      for (uint32_t c = 0; c < group.channels; ++c)
        patches.push_back(group.scale[c] * (static_cast<float>(row * 14 + c) - 30.4f));
    }
  }
  patches[0] = 1e6f, patches[1] = -1e6f;
  std::vector<int8_t> integers;
  const StaticPart part = decode_static_part(sampler, patches, integers);
  ASSERT_EQ(part.groups.size(), 2u);
  for (size_t g = 0; g < 2; ++g) {
    const StaticGroup& group = part.groups[g];
    EXPECT_EQ(group.grid_size, sampler.static_groups[g].grid_size);
    for (size_t i = 0; i < group.values.size(); ++i) {
      const auto row = static_cast<int>(i / group.channels),
                 c = static_cast<int>(i % group.channels);
      if (g == 0 && row == 1 && c < 2) {
        EXPECT_EQ(group.values[i], c == 0 ? 127 : -127);
      } else {
        EXPECT_EQ(group.values[i], row * 14 + c - 30) << g << " " << i;
      }
    }
  }
}

TEST(AvatarSampler, MakesStaticPartsOverOneNetwork) {
  const samples::StaticSamplerSample sample;
  const Sampler& description = sample.sampler;
  auto created = AvatarSampler::create(description);
  ASSERT_TRUE(created.ok()) << created.status().message();
  SampledAvatar person, other, again;
  ASSERT_TRUE((*created)->sample({.seed = 5}, person).ok());
  ASSERT_TRUE((*created)->sample({.seed = 6}, other).ok());
  ASSERT_TRUE((*created)->sample({.seed = 5}, again).ok());
  const Avatar& avatar = person.avatar();
  EXPECT_TRUE(validate_static_part(avatar.static_part, 8).ok());
  EXPECT_TRUE(avatar.antialiased);
  EXPECT_EQ(avatar.texels_a_side(), 8u);
  EXPECT_EQ(avatar.shape.size(), 2u);
  for (size_t i = 0; i < avatar.network.layers.size(); ++i) {
    EXPECT_TRUE(std::ranges::equal(avatar.network.layers[i].weights,
                                   description.network.layers[i].weights));
  }
  EXPECT_TRUE(validate_fixed_point(avatar.network, avatar.fixed_point).ok());
  const auto hash = [](const SampledAvatar& of) {
    return hash_weights(of.avatar().fixed_point, of.avatar().shape, of.avatar().static_part);
  };
  EXPECT_EQ(hash(person), hash(again));
  EXPECT_NE(hash(person), hash(other));
  size_t differ = 0;
  for (size_t g = 0; g < 2; ++g) {
    const std::span<const int8_t> a = avatar.static_part.groups[g].values,
                                  b = other.avatar().static_part.groups[g].values;
    for (size_t i = 0; i < a.size(); ++i) differ += a[i] != b[i];
  }
  EXPECT_GT(differ, 0u);
}

class Counted : public AvatarSampler::Trace {
 public:
  explicit Counted(uint32_t fail_at = 0) : fail_at_(fail_at) {}
  Status after_step(uint32_t step, double lambda, const SampledAvatar& avatar) override {
    EXPECT_EQ(step, steps_ + 1);
    EXPECT_GT(lambda, last_lambda_);
    EXPECT_TRUE(validate_fixed_point(avatar.avatar().network, avatar.avatar().fixed_point).ok());
    steps_ = step, last_lambda_ = lambda;
    return step == fail_at_ ? Status(StatusCode::kIo, "disk full") : Status();
  }
  uint32_t steps() const { return steps_; }

 private:
  uint32_t fail_at_, steps_ = 0;
  double last_lambda_ = -std::numeric_limits<double>::infinity();
};

TEST_F(AvatarSamplerTest, TheTraceSeesEveryStepAndChangesNothing) {
  SampledAvatar person;
  Counted trace;
  ASSERT_TRUE(sampler_->sample({.seed = 1, .steps = 6}, person, &trace).ok());
  EXPECT_EQ(trace.steps(), 6u);
  EXPECT_EQ(hash_weights(person.avatar().fixed_point, person.avatar().shape),
            hash_of({.seed = 1, .steps = 6}));
}

TEST_F(AvatarSamplerTest, AnErrorOfTheTraceEndsTheSampling) {
  for (const uint32_t step : {1u, 6u}) {
    SampledAvatar person;
    Counted trace(step);
    const Status status = sampler_->sample({.seed = 1, .steps = 6}, person, &trace);
    EXPECT_EQ(status.code(), StatusCode::kIo);
    EXPECT_EQ(trace.steps(), step);
  }
}

// Found on x86-64 with AMX; the same under every CPU that the tests run on (scripts/test: the host,
// aarch64 A76 and A53).
TEST_F(AvatarSamplerTest, EveryCpuHasTheseBits) {
  EXPECT_EQ(format_hash(hash_of({.seed = 1})), "67c003fb1c5a66be22aaad30e5dffc45");
  EXPECT_EQ(format_hash(hash_of(
                {.seed = 1, .to = 2, .mix = 0.25, .steps = 50, .method = SolverMethod::kDdim})),
            "12801b0702f0cb18a318ea45195af522");
}

}  // namespace
}  // namespace figurine::device_sampler_test
