// The head from a coarse network and static values: equal to its definition in plain loops, a plain
// copy where neither is there, gradients equal to finite differences, and the same on any number of
// threads.
#include "toolchain/model/compose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "figurine/network.h"

namespace figurine::model::compose_test {
namespace {

// Two charts of 24 x 24 texels with a ragged edge, one column apart.
struct Charts {
  std::vector<uint32_t> texel;
  Body body;

  Charts() {
    for (uint32_t v = 1; v < 22; ++v) {
      for (uint32_t u = 0; u < 24; ++u) {
        const bool left = u < 11 - v % 3, right = u > 11 && u < 23;
        if (left || right) texel.push_back(v * 24 + u);
      }
    }
    body.uv_size = 24;
    body.texel = texel;
  }
};

struct Case {
  const char* name;
  HeadLayout layout;
};

std::vector<Case> cases() {
  const uint32_t flat = head_channels(0), round = head_channels(2);
  return {{"network at half", {12, flat, {}}},
          {"static alone", {0, flat, {{0, 14, 24}}}},
          {"all at T", {24, flat, {{0, 14, 24}}}},
          {"colour at T, rest at T/2, network at T/4",
           {6, round, {{kStaticColour, 3, 24}, {0, 11, 12}}}},
          {"one colour and rotation, as a sum",
           {12, round, {{12, 1, 12}, {6, 4, 24}}, StaticColour::kSum}},
          {"one colour and rotation, as a gain", {12, round, {{12, 1, 12}, {6, 4, 24}}}}};
}

template <class Scalar>
std::vector<Scalar> random_values(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Scalar> values(count);
  for (Scalar& value : values) value = Scalar(0.5 * normal(random));
  return values;
}

size_t network_values(const HeadLayout& layout) {
  return size_t(layout.network_size) * layout.network_size * layout.channels;
}

// A grid's value at a texel, from the words of texel_grid.h alone.
template <class RowOf>
double tap(const std::vector<GridTaps>& taps, uint32_t texel, const RowOf& value_of_row) {
  double sum = 0;
  for (int k = 0; k < 4; ++k)
    sum += double(taps[texel].weight[k]) * value_of_row(taps[texel].row[k]);
  return sum;
}

// [N,C] by the equations of StaticPart.
std::vector<double> defined_head(const Body& body, const HeadLayout& layout,
                                 const std::vector<double>& network,
                                 const std::vector<double>& statics) {
  const uint32_t channels = layout.channels;
  std::vector<double> head(size_t(body.texel_count()) * channels, 0.0), s(head.size(), 0.0);
  if (layout.network_size > 0) {
    const TexelGrid grid = make_texel_grid(body, layout.network_size);
    const std::vector<GridTaps> taps = make_grid_taps(body, grid);
    for (size_t at = 0; at < head.size(); ++at) {
      head[at] = tap(taps, uint32_t(at / channels), [&](uint32_t row) {
        return network[size_t(grid.cell[row]) * channels + at % channels];
      });
    }
  }
  const double* group_values = statics.data();
  for (const StaticChannels& group : layout.statics) {
    const TexelGrid grid = make_texel_grid(body, group.grid_size);
    const std::vector<GridTaps> taps = make_grid_taps(body, grid);
    for (uint32_t i = 0; i < body.texel_count(); ++i) {
      for (uint32_t c = 0; c < group.count; ++c) {
        s[size_t(i) * channels + group.first + c] =
            tap(taps, i, [&](uint32_t row) { return group_values[size_t(row) * group.count + c]; });
      }
    }
    group_values += size_t(grid.cell_count()) * group.count;
  }
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    double* const h = &head[size_t(i) * channels];
    const double* const at = &s[size_t(i) * channels];
    for (uint32_t c = 0; c < kStaticChannels; ++c) {
      if (c < kStaticColour || layout.colour == StaticColour::kSum) {
        h[c] += at[c];
        continue;
      }
      h[c] = (h[c] + double(kHalfColour)) * std::exp(at[c]) - double(kHalfColour);
      for (uint32_t k = c + 3; k < channels; k += 3) h[k] *= std::exp(at[c]);
    }
  }
  return head;
}

TEST(HeadComposer, EqualsTheDefinition) {
  const Charts charts;
  for (const auto& [name, layout] : cases()) {
    const HeadComposer composer(charts.body, layout);
    const std::vector<double> network = random_values<double>(network_values(layout), 1),
                              statics = random_values<double>(composer.static_count(), 2);
    std::vector<double> head(size_t(composer.texel_count()) * layout.channels);
    composer.forward(network.data(), statics.data(), 1, head.data());
    const std::vector<double> expected = defined_head(charts.body, layout, network, statics);
    double largest = 0;
    for (size_t i = 0; i < head.size(); ++i)
      largest = std::max(largest, std::abs(head[i] - expected[i]));
    std::printf("%s: largest error %.3g\n", name, largest);
    EXPECT_LT(largest, 1e-14) << name;
    const std::vector<float> narrow_network(network.begin(), network.end()),
        narrow_statics(statics.begin(), statics.end());
    std::vector<float> narrow(head.size());
    composer.forward(narrow_network.data(), narrow_statics.data(), 2, narrow.data());
    for (size_t i = 0; i < head.size(); ++i) ASSERT_NEAR(narrow[i], head[i], 2e-6) << name;
  }
}

TEST(HeadComposer, WithoutStaticPartAtFullSizeCopiesTheNetworksBits) {
  const Charts charts;
  const HeadLayout layout{24, head_channels(1), {}};
  const HeadComposer composer(charts.body, layout);
  EXPECT_EQ(composer.static_count(), 0u);
  const std::vector<float> network = random_values<float>(network_values(layout), 3);
  std::vector<float> head(charts.texel.size() * layout.channels), back(network.size(), 7.0f);
  composer.forward<float>(network.data(), nullptr, 2, head.data());
  for (size_t i = 0; i < head.size(); ++i) {
    ASSERT_EQ(
        head[i],
        network[size_t(charts.texel[i / layout.channels]) * layout.channels + i % layout.channels]);
  }
  composer.backward<float>(network.data(), nullptr, head.data(), 2, back.data(), nullptr);
  std::vector<float> expected(network.size(), 0.0f);
  for (size_t i = 0; i < head.size(); ++i)
    expected[size_t(charts.texel[i / layout.channels]) * layout.channels + i % layout.channels] =
        head[i];
  EXPECT_EQ(back, expected);
}

// d(weights . head)/d(value), the difference taken per output.
double numeric_gradient(double& value, const std::vector<double>& weights,
                        const std::function<std::vector<double>()>& evaluate) {
  constexpr double kStep = 1e-6;
  const double kept = value;
  value = kept + kStep;
  const std::vector<double> above = evaluate();
  value = kept - kStep;
  const std::vector<double> below = evaluate();
  value = kept;
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) sum += weights[i] * (above[i] - below[i]);
  return sum / (2 * kStep);
}

TEST(HeadComposer, GradientsEqualFiniteDifferences) {
  const Charts charts;
  for (const auto& [name, layout] : cases()) {
    const HeadComposer composer(charts.body, layout);
    std::vector<double> network = random_values<double>(network_values(layout), 4),
                        statics = random_values<double>(composer.static_count(), 5);
    const size_t outputs = size_t(composer.texel_count()) * layout.channels;
    const std::vector<double> weights = random_values<double>(outputs, 6);
    const auto evaluate = [&] {
      std::vector<double> head(outputs);
      composer.forward(network.data(), statics.data(), 1, head.data());
      return head;
    };
    std::vector<double> d_network(network.size(), 1.0), d_statics(statics.size(), 1.0);
    composer.backward(network.data(), statics.data(), weights.data(), 1, d_network.data(),
                      d_statics.data());
    double largest = 0;
    for (auto [values, gradient] : {std::pair{&network, &d_network}, {&statics, &d_statics}}) {
      for (size_t i = 0; i < values->size(); i += 5) {
        const double numeric = numeric_gradient((*values)[i], weights, evaluate);
        largest = std::max(largest,
                           std::abs(numeric - (*gradient)[i]) / std::max(1.0, std::abs(numeric)));
      }
    }
    std::printf("%s: largest error of a gradient %.3g\n", name, largest);
    EXPECT_LT(largest, 1e-8) << name;  // central differences in double, step 1e-6
  }
}

TEST(HeadComposer, GradientsAreTheSameBitsOnAnyNumberOfThreads) {
  const Charts charts;
  for (const auto& [name, layout] : cases()) {
    const HeadComposer composer(charts.body, layout);
    const std::vector<float> network = random_values<float>(network_values(layout), 7),
                             statics = random_values<float>(composer.static_count(), 8),
                             weights = random_values<float>(
                                 size_t(composer.texel_count()) * layout.channels, 9);
    std::vector<float> d_network(network.size()), d_statics(statics.size()),
        other_network(network.size(), 1.0f), other_statics(statics.size(), 1.0f);
    composer.backward(network.data(), statics.data(), weights.data(), 1, d_network.data(),
                      d_statics.data());
    composer.backward(network.data(), statics.data(), weights.data(), 3, other_network.data(),
                      other_statics.data());
    EXPECT_EQ(d_network, other_network) << name;
    EXPECT_EQ(d_statics, other_statics) << name;
  }
}

TEST(HeadComposer, HiddenTexelsPassNothingOnWhateverTheirValuesAre) {
  const Charts charts;
  const HeadLayout layout{24, head_channels(1), {{0, 14, 24}}};
  const HeadComposer composer(charts.body, layout);
  std::vector<float> network(network_values(layout), 0.1f), statics(composer.static_count(), 0.1f);
  network[size_t(charts.texel[5]) * layout.channels + 12] = INFINITY;
  statics[5 * 14 + 12] = NAN;
  std::vector<float> gradient(charts.texel.size() * layout.channels, 1.0f),
      d_network(network.size()), d_statics(statics.size());
  std::fill_n(&gradient[5 * layout.channels], layout.channels, 0.0f);
  composer.backward(network.data(), statics.data(), gradient.data(), 1, d_network.data(),
                    d_statics.data());
  for (float value : d_network) ASSERT_TRUE(std::isfinite(value));
  for (float value : d_statics) ASSERT_TRUE(std::isfinite(value));
  EXPECT_EQ(d_statics[5 * 14 + 12], 0);
}

}  // namespace
}  // namespace figurine::model::compose_test
