// Avatars with a static part, a network coarser than the texels, or no network: what goes in comes
// out, what cannot be true is refused, and an avatar of neither kind has the bytes that it had.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"

namespace figurine::package_static_test {
namespace {

using samples::AvatarSample;
using samples::BodySample;
using samples::ExactBytes;
using samples::expect_refused;
using samples::open_or_die;
using samples::Opened;
using samples::same;
using samples::StaticAvatarSample;
using samples::StaticOnlyAvatarSample;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

template <class Sample = StaticAvatarSample, class Bend>
Status bent(const Bend& bend) {
  Sample sample;
  bend(sample);
  return sample.write().status();
}

// The status of opening what the writer would have refused: bent after it was taken apart.
template <class Sample = StaticAvatarSample, class Bend>
Status bent_parts(const Bend& bend) {
  Sample sample;
  PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
  bend(sample, parts);
  const ExactBytes bytes(assemble(parts));
  return Package::open(bytes.bytes(), "bent.fgn").status();
}

BlobPart& blob(PackageParts& parts, const std::string& name) {
  for (BlobPart& part : parts.blobs) {
    if (part.name == name) return part;
  }
  ADD_FAILURE() << "no blob " << name;
  return parts.blobs.front();
}

TEST(PackageStatic, KeepsGroupsGridsAndTheNetworksPlace) {
  const StaticAvatarSample sample;
  const Opened opened = open_or_die(sample.write());
  const Avatar& out = opened.package.avatar();
  EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart);
  EXPECT_EQ(out.texels_a_side(), 8u);
  EXPECT_EQ(out.network.input_size, 4u);
  EXPECT_TRUE(out.has_network());
  ASSERT_EQ(out.static_part.groups.size(), 2u);
  for (size_t g = 0; g < 2; ++g) {
    const StaticGroup &a = sample.avatar.static_part.groups[g], &b = out.static_part.groups[g];
    EXPECT_EQ(a.first_channel, b.first_channel);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.grid_size, b.grid_size);
    EXPECT_TRUE(same(a.values, b.values));
    EXPECT_TRUE(same(a.scale, b.scale));
  }
  EXPECT_EQ(*sample.write(), *StaticAvatarSample().write());
}

TEST(PackageStatic, AnAvatarWithoutANetworkHoldsEveryPrecision) {
  const Opened opened = open_or_die(StaticOnlyAvatarSample().write());
  const Avatar& out = opened.package.avatar();
  EXPECT_FALSE(out.has_network());
  EXPECT_TRUE(out.holds(Precision::kFloat32));
  EXPECT_TRUE(out.holds(Precision::kFixedPoint));
  EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart);
  EXPECT_EQ(out.texels_a_side(), 8u);
  EXPECT_EQ(out.golden.fixed_point_hash, StaticOnlyAvatarSample().avatar.golden.fixed_point_hash);
}

TEST(PackageStatic, ACoarserNetworkAloneSetsTheFeature) {
  StaticAvatarSample sample;
  sample.avatar.static_part = {};
  const Opened opened = open_or_die(sample.write());
  EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart);
  EXPECT_EQ(opened.package.avatar().texels_a_side(), 8u);
}

TEST(PackageStatic, AStaticPartGoesWithANetworkAtEveryTexel) {
  StaticAvatarSample sample;
  const AvatarSample plain;
  sample.avatar.network = plain.avatar.network;
  sample.avatar.uv_size = 0;
  sample.budget = plain.budget;
  const Opened opened = open_or_die(sample.write());
  EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart);
  EXPECT_EQ(opened.package.avatar().texels_a_side(), 8u);
}

TEST(PackageStatic, WithoutAnyOfItAnAvatarHasTheBytesThatItHad) {
  AvatarSample said;
  said.avatar.uv_size = said.avatar.network.input_size;
  EXPECT_EQ(*said.write(), *AvatarSample().write());
}

TEST(PackageStatic, RejectsChannelsThatAreNoneTooManyOrTwice) {
  const auto first = [](uint32_t channel) {
    return bent([=](StaticAvatarSample& s) { s.group(0).first_channel = channel; });
  };
  expect_refused(first(1), "static part: group 1: another group has one of its channels");
  expect_refused(first(4), "static part: group 0: its channels are none, or beyond the 14");
  expect_refused(first(UINT32_MAX), "static part: group 0: its channels are none, or beyond");
  expect_refused(
      bent([](StaticAvatarSample& s) { s.avatar.static_part.groups.resize(15, s.group(1)); }),
      "avatar.static_groups: has more than 14 groups", StatusCode::kLimitExceeded);
  expect_refused(bent([](StaticAvatarSample& s) {
                   const std::vector<float> many(15, 1.0f);
                   s.colour_scale = many;
                   s.avatar.static_part.groups = {{.first_channel = 0,
                                                   .channels = 15,
                                                   .grid_size = 8,
                                                   .values = s.colour,
                                                   .scale = s.colour_scale}};
                 }),
                 "static part: group 0: its channels are none, or beyond");
}

TEST(PackageStatic, RejectsGridsThatDoNotFitTheMap) {
  for (const uint32_t size : {0u, 3u, 16u, UINT32_MAX}) {
    expect_refused(bent([=](StaticAvatarSample& s) { s.group(0).grid_size = size; }),
                   "static part: group 0: its grid does not have");
  }
  expect_refused(bent([](StaticAvatarSample& s) { s.group(1).grid_size = 1; }),
                 "group 1: its values are not one for each channel of each cell");
  for (const uint32_t size : {1u, 2u, 4u, 8u}) {
    StaticAvatarSample sample;
    sample.avatar.static_part.groups.pop_back();
    sample.group(0).values = sample.group(0).values.first(kStaticColour);
    sample.group(0).grid_size = size;
    EXPECT_TRUE(sample.write().ok()) << size;
  }
}

TEST(PackageStatic, RejectsBlobsOfAnotherShape) {
  const auto part = [](const std::string& name, const std::vector<uint32_t>& shape) {
    return bent_parts(
        [&](StaticAvatarSample&, PackageParts& parts) { blob(parts, name).shape = shape; });
  };
  expect_refused(part("static.1.values", {3, 5}), "static.1.values: has shape [3,5]");
  expect_refused(part("static.1.values", {15}), "static.1.values: has shape [15]");
  expect_refused(part("static.0.values", {11, 2}), "static.0.values: has shape [11,2]");
  expect_refused(part("static.1.scale", {3, 1}), "static.1.scale: has shape [3,1]");
  expect_refused(bent_parts([](StaticAvatarSample&, PackageParts& parts) {
                   blob(parts, "static.0.values").name = "static.2.values";
                 }),
                 "static.0.values: is missing");
  expect_refused(bent_parts([](StaticAvatarSample&, PackageParts& parts) {
                   blob(parts, "static.0.values").type = DataType::kU8;
                 }),
                 "static.0.values: is u8, not i8");
  // Values of a group that the list does not have.
  expect_refused(bent_parts([](StaticAvatarSample& s, PackageParts&) {
                   s.avatar.static_part.groups.pop_back();
                 }),
                 "static.1.", StatusCode::kUnsupported);
}

TEST(PackageStatic, RejectsValuesAndScalesThatMeanNothing) {
  expect_refused(bent([](StaticAvatarSample& s) { s.geometry[7] = -128; }),
                 "static part: group 0: a value is -128");
  for (const float scale :
       {0.0f, -0.125f, kNan, kInfinity, std::numeric_limits<float>::denorm_min()}) {
    expect_refused(bent([&](StaticAvatarSample& s) { s.colour_scale[2] = scale; }),
                   "static part: group 1: a scale is not positive and normal");
  }
  const auto with = [](float geometry, float colour) {
    return bent([=](StaticAvatarSample& s) {
      s.geometry_scale[10] = geometry;
      s.colour_scale[0] = colour;
    });
  };
  EXPECT_TRUE(with(7.8f, 0.157f).ok());
  expect_refused(with(7.9f, 0.125f), "group 0: a scale is too large");
  expect_refused(with(0.125f, 0.158f), "group 1: a scale is too large");
}

TEST(PackageStatic, RejectsMapsThatTheNetworkDoesNotFit) {
  const auto size = [](uint32_t texels) {
    return bent([=](StaticAvatarSample& s) { s.avatar.uv_size = texels; });
  };
  for (const uint32_t texels : {2u, 12u, 64u})
    expect_refused(size(texels), "avatar.uv_size: is not 1, 2, 4 or 8 times");
  expect_refused(size(2048), "avatar.uv_size: is larger than 1024", StatusCode::kLimitExceeded);
  expect_refused(bent([](StaticAvatarSample& s) { s.budget.gaussians = 65; }),
                 "budget.gaussians: is more than the map has texels");
}

TEST(PackageStatic, RejectsHalfOfANetwork) {
  using Only = StaticOnlyAvatarSample;
  expect_refused(bent<Only>([](Only& s) { s.avatar.network.input_size = 4; }),
                 "network: has an input, and no layers");
  expect_refused(bent<Only>([](Only& s) { s.avatar.network.input_channels = 6; }),
                 "network: has an input, and no layers");
  expect_refused(bent<Only>([](Only& s) { s.avatar.fourier_octaves = 1; }),
                 "avatar.fourier_octaves: is not 0, and there is no network");
  expect_refused(bent<Only>([](Only& s) { s.avatar.uv_size = 0; }),
                 "avatar.uv_size: is missing, and there is no network");
  expect_refused(bent<Only>([](Only& s) { s.avatar.static_part = {}; }),
                 "avatar: has neither a network nor a static part");
  expect_refused(bent<Only>([](Only& s) { s.avatar.fixed_point.convolutions.resize(1); }),
                 "avatar.fixed_point: is there, a network is not");
}

TEST(PackageStatic, TheHeaderPromisesWhatIsThere) {
  const auto features = [](uint64_t bits) {
    return [=](auto&, PackageParts& parts) { parts.required_features = bits; };
  };
  const std::string words = "the bit of static parts is not set, such an avatar is there";
  expect_refused(bent_parts<StaticAvatarSample>(features(0)), words);
  expect_refused(bent_parts<StaticOnlyAvatarSample>(features(0)), words);
  expect_refused(bent_parts<AvatarSample>(features(kFeatureStaticPart)),
                 "the bit of static parts is set, such an avatar is not there");
}

TEST(PackageStatic, APopulationsMembersHaveTheSameGroupsAndTexels) {
  samples::PopulationSample sample;
  const StaticAvatarSample with;
  sample.avatars[1]->avatar.static_part = with.avatar.static_part;
  expect_refused(sample.write().status(), "its static part has other groups",
                 StatusCode::kMismatch);
  sample.avatars[1]->avatar.static_part = {};
  sample.avatars[1]->avatar.uv_size = 16;
  expect_refused(sample.write().status(), "is drawn otherwise", StatusCode::kMismatch);
  sample.avatars[1]->avatar.uv_size = 8;
  EXPECT_TRUE(sample.write().ok());
}

TEST(PackageStatic, FitsTheBodyWhoseCellsItHas) {
  const BodySample body_sample;
  const Opened body = open_or_die(body_sample.write());
  const auto fit = [&](auto sample, const std::function<void(StaticAvatarSample&)>& bend) {
    sample->avatar.body_hash = body.package.content_hash();
    bend(*sample);
    return check_avatar_fits_body(sample->avatar, body.package);
  };
  const auto whole = [] { return std::make_unique<StaticAvatarSample>(); };
  EXPECT_TRUE(fit(whole(), [](StaticAvatarSample&) {}).ok());
  EXPECT_TRUE(fit(std::make_unique<StaticOnlyAvatarSample>(), [](StaticAvatarSample&) {}).ok());
  expect_refused(fit(whole(), [](StaticAvatarSample& s) { s.avatar.uv_size = 16; }),
                 "its map has 16 texels a side, the body's 8", StatusCode::kMismatch);
  expect_refused(fit(whole(), [](StaticAvatarSample& s) { s.avatar.uv_size = 0; }),
                 "its map has 4 texels a side, the body's 8", StatusCode::kMismatch);
  expect_refused(fit(whole(), [](StaticAvatarSample& s) { s.group(0).grid_size = 4; }),
                 "group 0: has values for 2 cells, the body covers 5", StatusCode::kMismatch);
  expect_refused(
      fit(whole(), [](StaticAvatarSample& s) { s.group(1).values = s.group(1).values.first(12); }),
      "group 1: has values for 4 cells, the body covers 5", StatusCode::kMismatch);
}

}  // namespace
}  // namespace figurine::package_static_test
