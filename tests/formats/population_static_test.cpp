// Populations whose members have static parts, with a network each or one for all: integers come
// back as they were, what does not belong together is refused, and so is what cannot be true.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>

#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"

namespace figurine::population_static_test {
namespace {

using samples::ExactBytes;
using samples::expect_refused;
using samples::open_or_die;
using samples::Opened;
using samples::same;
using samples::StaticPopulationSample;

constexpr DifferenceCoding kCodings[] = {DifferenceCoding::kInt8, DifferenceCoding::kHalf,
                                         DifferenceCoding::kNone};

TEST(StaticCode, EveryIntegerComesBackFromEveryPrediction) {
  for (int predicted = -127; predicted <= 127; ++predicted) {
    for (int value = -127; value <= 127; ++value) {
      const int8_t p = static_cast<int8_t>(predicted), v = static_cast<int8_t>(value),
                   d = subtract_static(v, p);
      ASSERT_NE(d, -128);
      ASSERT_EQ(add_static(p, d), v) << predicted << " " << value;
    }
    for (int d = -127; d <= 127; ++d)
      ASSERT_NE(add_static(static_cast<int8_t>(predicted), static_cast<int8_t>(d)), -128);
  }
}

TEST(StaticCode, PredictsToNearestWithinTheRange) {
  EXPECT_EQ(predict_static(0.75f, 0.5f), 2) << "1.5, to even";
  EXPECT_EQ(predict_static(1.25f, 0.5f), 2) << "2.5, to even";
  EXPECT_EQ(predict_static(-1, 0.25f), -4);
  EXPECT_EQ(predict_static(1000, 1e-30f), 127);
  EXPECT_EQ(predict_static(-1000, 1e-30f), -127);
}

TEST(StaticPopulation, IntegersAndScalesComeBackAsTheyWere) {
  for (const DifferenceCoding coding : kCodings) {
    const StaticPopulationSample sample(coding);
    const Opened opened = open_or_die(sample.write());
    EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart | kFeatureFilters);
    const Population& population = opened.package.population();
    EXPECT_EQ(population.coding, coding);
    std::vector<float> storage(member_floats(population));
    for (size_t m = 0; m < 3; ++m) {
      const Avatar out = open_member(population, m, storage);
      const Avatar& in = sample.avatars[m]->avatar;
      EXPECT_EQ(out.texels_a_side(), 8u);
      EXPECT_EQ(out.network.input_size, 4u);
      EXPECT_TRUE(out.antialiased);
      EXPECT_TRUE(same(in.shape, out.shape));
      EXPECT_GT(difference_bytes(population, m), 0u);
      ASSERT_EQ(out.static_part.groups.size(), 2u);
      for (size_t g = 0; g < 2; ++g) {
        const StaticGroup &a = in.static_part.groups[g], &b = out.static_part.groups[g];
        EXPECT_EQ(a.first_channel, b.first_channel);
        EXPECT_EQ(a.channels, b.channels);
        EXPECT_EQ(a.grid_size, b.grid_size);
        EXPECT_TRUE(same(a.values, b.values)) << to_string(coding) << " " << m << " " << g;
        EXPECT_TRUE(same(a.scale, b.scale));
      }
      for (size_t i = 0; i < out.network.layers.size(); ++i) {
        const Layer& shared = sample.initial->avatar.network.layers[i];
        const auto& weights = out.network.layers[i].weights;
        if (coding == DifferenceCoding::kNone) {
          EXPECT_TRUE(same(weights, shared.weights));
          EXPECT_TRUE(same(out.network.layers[i].bias, shared.bias));
        } else if (coding == DifferenceCoding::kHalf) {
          EXPECT_TRUE(same(weights, std::span<const float>(sample.avatars[m]->weights[i])));
        }
      }
      const Opened alone = open_or_die(
          write_package(out, sample.initial->budget, opened.package.member_provenance(m)));
      EXPECT_TRUE(same(alone.package.avatar().static_part.groups[1].values,
                       in.static_part.groups[1].values));
    }
  }
}

TEST(StaticPopulation, OfOneNetworkHoldsItOnceAndTheSharedMap) {
  const StaticPopulationSample sample;
  const Opened opened = open_or_die(sample.write());
  const Population& population = opened.package.population();
  EXPECT_TRUE(population.bias.empty());
  EXPECT_TRUE(population.code.empty());
  for (size_t g = 0; g < 2; ++g) {
    EXPECT_TRUE(same(population.static_part.groups[g].values,
                     sample.initial->avatar.static_part.groups[g].values));
  }
  EXPECT_EQ(population.fourier_octaves, sample.initial->avatar.fourier_octaves);
  EXPECT_EQ(population.members[2].map_statistics.mean, sample.initial->avatar.map_statistics.mean);
}

TEST(StaticPopulation, MapsNearTheMeanTakeFewerBytesThanTheyAre) {
  StaticPopulationSample near;
  for (size_t m = 0; m < 3; ++m) {
    near.avatars[m]->geometry = near.initial->geometry;
    near.avatars[m]->geometry_scale = near.initial->geometry_scale;
    near.avatars[m]->avatar.static_part.groups[0].values = near.avatars[m]->geometry;
    near.avatars[m]->avatar.static_part.groups[0].scale = near.avatars[m]->geometry_scale;
  }
  const Opened like = open_or_die(near.write()),
               unlike = open_or_die(StaticPopulationSample().write());
  EXPECT_LT(like.package.population().static_code.size(),
            unlike.package.population().static_code.size());
}

Status bent(const std::function<void(StaticPopulationSample&)>& bend,
            DifferenceCoding coding = DifferenceCoding::kNone) {
  StaticPopulationSample sample(coding);
  bend(sample);
  return sample.write().status();
}

TEST(StaticPopulation, NamesTheMemberThatDiffers) {
  for (const DifferenceCoding coding : kCodings) {
    const auto refused = [&](const std::string& words, const std::function<void(Avatar&)>& bend) {
      expect_refused(bent([&](StaticPopulationSample& s) { bend(s.avatars[1]->avatar); }, coding),
                     "member 'person 1': " + words, StatusCode::kMismatch);
    };
    refused("its static part has other groups", [](Avatar& a) { a.static_part.groups.pop_back(); });
    refused("its static part has other groups",
            [](Avatar& a) { a.static_part.groups[0].grid_size = 4; });
    refused("is drawn otherwise", [](Avatar& a) { a.antialiased = false; });
    refused("has smallest extents", [](Avatar& a) {
      static const uint8_t codes[5] = {};
      a.smallest_extents = {.scale_m = 1e-3f, .codes = codes};
    });
    refused("has 1 shape coefficients", [](Avatar& a) { a.shape = a.shape.first(1); });
    refused("was made for the body", [](Avatar& a) { a.body_hash[0] ^= 1; });
  }
  expect_refused(bent([](StaticPopulationSample& s) { s.avatars[1]->weights[0][3] += 1; }),
                 "member 'person 1': its network has other weights than that of 'shared'",
                 StatusCode::kMismatch);
  expect_refused(bent([](StaticPopulationSample& s) { s.population.shared = nullptr; }),
                 "a shared avatar goes with", StatusCode::kInvalidArgument);
  expect_refused(
      bent([](StaticPopulationSample& s) { s.population.coding = DifferenceCoding::kInt8; }),
      "a shared avatar goes with", StatusCode::kInvalidArgument);
}

Status bent_parts(const std::function<void(PackageParts&, Population&)>& bend) {
  const StaticPopulationSample sample;
  const Opened opened = open_or_die(sample.write());
  Population population = opened.package.population();
  const std::vector<Provenance> own(population.size());
  PackageParts parts =
      *take_apart(population, opened.package.budget(), opened.package.provenance(), own);
  bend(parts, population);
  const ExactBytes bytes(assemble(parts));
  const Result<Package> bent = Package::open(bytes.bytes(), "bent.fgn");
  std::string reason;
  if (bent.ok() && !samples::exercise(*bent, reason))
    return Status(StatusCode::kInvalidArgument, "opened, but: " + reason);
  return bent.status();
}

template <class T>
Status with_value(const std::string& name, size_t index, T value) {
  std::vector<std::byte> bytes;
  return bent_parts([&](PackageParts& parts, Population&) {
    const auto blob = std::ranges::find(parts.blobs, name, &BlobPart::name);
    FIG_CHECK(blob != parts.blobs.end(), name.c_str());
    bytes.assign(blob->bytes.begin(), blob->bytes.end());
    std::memcpy(bytes.data() + index * sizeof(T), &value, sizeof(T));
    blob->bytes = bytes;
  });
}

TEST(PackageStaticPopulation, IsSoundBeforeItIsBent) {
  EXPECT_TRUE(bent_parts([](PackageParts&, Population&) {}).ok());
  EXPECT_TRUE(with_value("population.static_scale", 3, 0.5f).ok());
  EXPECT_TRUE(with_value<uint8_t>("population.static_code", 9, 0xFF).ok()) << "some other person";
  EXPECT_TRUE(with_value("population.static_code_end", 0, 0u).ok());
}

TEST(PackageStaticPopulation, RejectsWhatCannotBe) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (const float value : {0.0f, -1.0f, kNan, 1e-40f, 8.0f}) {
    expect_refused(with_value("population.static_scale", 14 + 12, value),
                   "population.static_scale: member 1: static part: group 1");
  }
  expect_refused(with_value<int16_t>("population.static_frequency", 255 + 3, -1),
                 "population.static_frequency: value 258 is negative");
  expect_refused(with_value<int16_t>("population.static_frequency", 255, 5000),
                 "population.static_frequency: row 1 has the sum");
  expect_refused(with_value("population.static_code_end", 2, UINT32_MAX),
                 "population.static_code_end");
  expect_refused(with_value<int8_t>("static.0.values", 0, -128), "static part: group 0: a value");
  const auto with_index = [](const std::function<void(Population&)>& bend) {
    return bent_parts([&](PackageParts&, Population& population) { bend(population); });
  };
  expect_refused(with_index([](Population& p) { p.uv_size = 6; }), "population.uv_size");
  expect_refused(with_index([](Population& p) { p.antialiased = false; }), "the bit of filters");
  expect_refused(with_index([](Population& p) { p.static_part.groups[1].first_channel = 5; }),
                 "static part: group 1: another group has one of its channels");
  for (const uint64_t feature : {kFeatureStaticPart, kFeatureFilters}) {
    expect_refused(
        bent_parts([&](PackageParts& parts, Population&) { parts.required_features &= ~feature; }),
        "header.required_features");
  }
  for (const char* name :
       {"static.0.values", "static.1.scale", "population.static_scale",
        "population.static_frequency", "population.static_code", "population.static_code_end"}) {
    expect_refused(bent_parts([&](PackageParts& parts, Population&) {
                     std::erase_if(parts.blobs,
                                   [&](const BlobPart& blob) { return blob.name == name; });
                   }),
                   std::string(name) + ": is missing");
  }
}

}  // namespace
}  // namespace figurine::population_static_test
