// Samplers of static parts over one network: what goes in comes out, and what cannot be true is
// refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>

#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/writer/package_parts.h"

namespace figurine::sampler_static_test {
namespace {

using samples::ExactBytes;
using samples::open_or_die;
using samples::Opened;
using samples::same;
using samples::StaticSamplerSample;

void expect_refused(const Status& status, const std::string& words,
                    StatusCode code = StatusCode::kCorrupt) {
  EXPECT_STREQ(to_string(status.code()), to_string(code)) << status.message();
  EXPECT_NE(status.message().find(words), std::string::npos)
      << status.message() << " should mention: " << words;
}

TEST(StaticSampler, KeepsTheNetworkTheGroupsAndTheirPatches) {
  const StaticSamplerSample sample;
  const Opened opened = open_or_die(sample.write());
  EXPECT_EQ(opened.package.required_features(),
            kFeatureFixedPoint | kFeatureStaticPart | kFeatureFilters);
  const Sampler &in = sample.sampler, &out = opened.package.sampler();
  EXPECT_TRUE(out.shares_network);
  EXPECT_TRUE(out.antialiased);
  EXPECT_EQ(out.texels_a_side(), 8u);
  EXPECT_TRUE(has_weights(out.network));
  for (size_t i = 0; i < in.network.layers.size(); ++i) {
    EXPECT_TRUE(same(in.network.layers[i].weights, out.network.layers[i].weights));
    if (in.network.layers[i].op != LayerOp::kConv2d) continue;
    EXPECT_TRUE(
        same(in.fixed_point.convolutions[i].weights, out.fixed_point.convolutions[i].weights));
  }
  EXPECT_EQ(out.fixed_point.values, out.values);
  ASSERT_EQ(out.static_groups.size(), 2u);
  for (size_t g = 0; g < 2; ++g) {
    const SampledStaticGroup &a = in.static_groups[g], &b = out.static_groups[g];
    EXPECT_EQ(a.first_channel, b.first_channel);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.grid_size, b.grid_size);
    EXPECT_TRUE(same(a.scale, b.scale));
    EXPECT_TRUE(same(a.row, b.row));
    EXPECT_EQ(a.patch_rows, b.patch_rows);
  }
  // A token of the shape, then the patches; none of a convolution.
  EXPECT_EQ(sampler_token_sizes(out), (std::vector<size_t>{2, 11, 11, 9, 6}));
  EXPECT_EQ(*StaticSamplerSample().write(), *sample.write());
}

TEST(StaticSampler, MayHaveNetworksOfItsAvatarsOwn) {
  StaticSamplerSample sample;
  const samples::SamplerSample plain;
  EXPECT_EQ(sampler_token_sizes(plain.sampler).size(), 16u);
  Sampler own = sample.sampler;
  own.shares_network = false;
  EXPECT_EQ(sampler_token_sizes(own).size(), 16u + 4);
}

TEST(StaticSampler, AHashTellsStaticPartsApart) {
  const std::vector<float> shape{1, 2};
  const std::vector<int8_t> a{1, 2, 3}, b{1, 2, 4};
  const std::vector<float> scale{0.5f}, other{0.25f};
  const auto hash = [&](const std::vector<int8_t>& values, const std::vector<float>& scales) {
    StaticPart part;
    part.groups.push_back({0, 1, 8, values, scales});
    return hash_weights({}, shape, part);
  };
  EXPECT_EQ(hash(a, scale), hash(a, scale));
  EXPECT_NE(hash(a, scale), hash(b, scale));
  EXPECT_NE(hash(a, scale), hash(a, other));
  EXPECT_NE(hash(a, scale), hash_weights({}, shape));
}

Status bent_parts(const std::function<void(PackageParts&, Sampler&)>& bend) {
  const StaticSamplerSample sample;
  Sampler sampler = sample.sampler;
  sampler.golden = sampler.golden.without_picture();
  PackageParts parts = *take_apart(sampler, sample.budget, {});
  bend(parts, sampler);
  const ExactBytes bytes(assemble(parts));
  const Result<Package> opened = Package::open(bytes.bytes(), "bent.fgn");
  std::string reason;
  if (opened.ok() && !samples::exercise(*opened, reason))
    return Status(StatusCode::kInvalidArgument, "opened, but: " + reason);
  return opened.status();
}

template <class T>
Status with_value(const std::string& name, size_t index, T value) {
  std::vector<std::byte> bytes;
  return bent_parts([&](PackageParts& parts, Sampler&) {
    const auto blob = std::ranges::find(parts.blobs, name, &BlobPart::name);
    FIG_CHECK(blob != parts.blobs.end(), name.c_str());
    bytes.assign(blob->bytes.begin(), blob->bytes.end());
    std::memcpy(bytes.data() + index * sizeof(T), &value, sizeof(T));
    blob->bytes = bytes;
  });
}

Status with_index(const std::function<void(Sampler&)>& bend) {
  return bent_parts([&](PackageParts&, Sampler& sampler) { bend(sampler); });
}

TEST(PackageStaticSampler, IsSoundBeforeItIsBent) {
  const Status status = with_index([](Sampler&) {});
  EXPECT_TRUE(status.ok()) << status.message();
}

TEST(PackageStaticSampler, RejectsWhatCannotBe) {
  expect_refused(with_value("static.1.row", 2, 5u), "static.1.row: does not name every row");
  expect_refused(with_value("static.1.row", 2, 0u), "static.1.row: does not name every row");
  expect_refused(with_value("static.0.scale", 3, 0.0f), "static part: group 0: a scale");
  expect_refused(with_value("static.1.scale", 0, 1.0f), "static part: group 1: a scale");
  expect_refused(with_value<int8_t>("fixed.0.weights", 0, -128), "fixed point");
  expect_refused(with_value("network.0.weights", 0, std::numeric_limits<float>::quiet_NaN()),
                 "network.0.weights: value 0 is not finite");
  expect_refused(with_index([](Sampler& s) { s.static_groups[1].patch_rows = {3, 3}; }),
                 "static.1.patch_rows: count 6 cells");
  expect_refused(with_index([](Sampler& s) { s.static_groups[1].patch_rows = {5, 0}; }),
                 "static.1.patch_rows: a patch has no cells");
  expect_refused(with_index([](Sampler& s) { s.static_groups[1].patch_rows = {5}; }),
                 "sampler.ranks");
  expect_refused(with_index([](Sampler& s) { s.static_groups[1].first_channel = 5; }),
                 "static part: group 1: another group has one of its channels");
  expect_refused(with_index([](Sampler& s) { s.static_groups[0].grid_size = 3; }),
                 "static part: group 0: its grid");
  expect_refused(with_index([](Sampler& s) { s.antialiased = false; }), "the bit of filters");
  for (const uint64_t feature : {kFeatureFixedPoint, kFeatureStaticPart, kFeatureFilters}) {
    expect_refused(
        bent_parts([&](PackageParts& parts, Sampler&) { parts.required_features &= ~feature; }),
        "header.required_features");
  }
  for (const char* name :
       {"network.0.weights", "fixed.0.scale", "static.0.scale", "static.1.row"}) {
    expect_refused(bent_parts([&](PackageParts& parts, Sampler&) {
                     std::erase_if(parts.blobs,
                                   [&](const BlobPart& blob) { return blob.name == name; });
                   }),
                   std::string(name) + ": is missing");
  }
}

}  // namespace
}  // namespace figurine::sampler_static_test
