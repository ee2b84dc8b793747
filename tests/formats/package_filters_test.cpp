// Avatars with smallest extents, or splatted antialiased: what goes in comes out, what cannot be
// true is refused, and an avatar with neither has the bytes that it had.
#include <gtest/gtest.h>

#include <limits>

#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"

namespace figurine::package_filters_test {
namespace {

using samples::AvatarSample;
using samples::BodySample;
using samples::ExactBytes;
using samples::expect_refused;
using samples::FilteredAvatarSample;
using samples::open_or_die;
using samples::Opened;
using samples::same;

// The status of opening what the writer might have refused: bent after it was taken apart.
template <class Sample = FilteredAvatarSample, class Bend>
Status bent_parts(const Bend& bend) {
  Sample sample;
  PackageParts parts = *take_apart(sample.avatar, sample.budget, {});
  bend(sample, parts);
  const ExactBytes bytes(assemble(parts));
  return Package::open(bytes.bytes(), "bent.fgn").status();
}

BlobPart& extents_of(PackageParts& parts) {
  for (BlobPart& part : parts.blobs) {
    if (part.name == "filter.smallest_extent") return part;
  }
  ADD_FAILURE() << "no extents";
  return parts.blobs.front();
}

TEST(PackageFilters, KeepsExtentsAndFlag) {
  const FilteredAvatarSample sample;
  const Opened opened = open_or_die(sample.write());
  const Avatar& out = opened.package.avatar();
  EXPECT_EQ(opened.package.required_features(), kFeatureStaticPart | kFeatureFilters);
  EXPECT_TRUE(out.antialiased);
  EXPECT_EQ(out.smallest_extents.scale_m, sample.avatar.smallest_extents.scale_m);
  EXPECT_TRUE(same(out.smallest_extents.codes, sample.avatar.smallest_extents.codes));
  EXPECT_EQ(out.smallest_extents.extent_m(0), 0.0f);
  EXPECT_EQ(out.smallest_extents.extent_m(4), 255 * 0x1p-17f);
}

TEST(PackageFilters, EitherSetsTheFeature) {
  AvatarSample flag, extents;
  flag.avatar.antialiased = true;
  const Opened with_flag = open_or_die(flag.write());
  EXPECT_EQ(with_flag.package.required_features(), kFeatureFilters);
  EXPECT_TRUE(with_flag.package.avatar().smallest_extents.empty());
  const std::vector<uint8_t> codes(5, 9);
  extents.avatar.smallest_extents = {.scale_m = 1e-4f, .codes = codes};
  const Opened with_extents = open_or_die(extents.write());
  EXPECT_EQ(with_extents.package.required_features(), kFeatureFilters);
  EXPECT_FALSE(with_extents.package.avatar().antialiased);
}

TEST(PackageFilters, RejectsScalesThatMeanNothing) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                  kInfinity = std::numeric_limits<float>::infinity();
  for (const float scale : {kNan, kInfinity, -kInfinity, -1e-4f, 1e-38f, 9.9e-10f, 0.11f,
                            std::numeric_limits<float>::denorm_min()}) {
    FilteredAvatarSample sample;
    sample.avatar.smallest_extents.scale_m = scale;
    expect_refused(sample.write().status(),
                   "smallest extents: the scale is not within 1e-9 and 0.1 m");
  }
  for (const float scale : {1e-9f, 0.1f}) {
    FilteredAvatarSample sample;
    sample.avatar.smallest_extents.scale_m = scale;
    EXPECT_TRUE(sample.write().ok()) << scale;
  }
}

TEST(PackageFilters, RejectsOneWithoutTheOther) {
  // Codes that no scale asks for are a blob that nobody knows.
  FilteredAvatarSample sample;
  sample.avatar.smallest_extents.scale_m = 0;
  expect_refused(sample.write().status(), "filter.smallest_extent", StatusCode::kUnsupported);
  expect_refused(bent_parts([](FilteredAvatarSample& s, PackageParts& parts) {
                   s.avatar.smallest_extents.codes = {};
                   std::erase_if(parts.blobs, [](const BlobPart& part) {
                     return part.name == "filter.smallest_extent";
                   });
                 }),
                 "filter.smallest_extent: is missing");
  const SmallestExtents half{.scale_m = 1e-4f, .codes = {}};
  expect_refused(validate_smallest_extents(half, 8), "a scale without codes");
}

TEST(PackageFilters, RejectsBlobsOfAnotherShape) {
  expect_refused(bent_parts([](FilteredAvatarSample&, PackageParts& parts) {
                   extents_of(parts).shape = {5, 1};
                 }),
                 "filter.smallest_extent: has shape [5,1]");
  expect_refused(bent_parts([](FilteredAvatarSample&, PackageParts& parts) {
                   extents_of(parts).type = DataType::kI8;
                 }),
                 "filter.smallest_extent: is i8, not u8");
  const std::vector<uint8_t> many(65, 1);
  expect_refused(bent_parts([&](FilteredAvatarSample&, PackageParts& parts) {
                   extents_of(parts).shape = {65};
                   extents_of(parts).bytes = std::as_bytes(std::span(many));
                 }),
                 "smallest extents: more codes than the map has texels");
}

TEST(PackageFilters, TheHeaderPromisesWhatIsThere) {
  expect_refused(
      bent_parts([](auto&, PackageParts& parts) { parts.required_features &= ~kFeatureFilters; }),
      "the bit of filters is not set, such an avatar is there");
  expect_refused(bent_parts<AvatarSample>(
                     [](auto&, PackageParts& parts) { parts.required_features = kFeatureFilters; }),
                 "the bit of filters is set, such an avatar is not there");
}

TEST(PackageFilters, AReaderOfBeforeRefusesThem) {
  // Whoever does not know a bit says so before anything else is read: the mechanism, on the next
  // one that is free.
  expect_refused(bent_parts([](auto&, PackageParts& parts) {
                   parts.required_features |= kFeatureFilters << 1;
                 }),
                 "required_features", StatusCode::kUnsupported);
}

TEST(PackageFilters, APopulationsMembersHaveNoExtentsAndAreAntialiasedAllOrNone) {
  samples::PopulationSample sample;
  sample.avatars[1]->avatar.antialiased = true;
  expect_refused(sample.write().status(), "is drawn otherwise", StatusCode::kMismatch);
  for (const auto& avatar : sample.avatars) avatar->avatar.antialiased = true;
  const Opened all = open_or_die(sample.write());
  EXPECT_EQ(all.package.required_features(), kFeatureFilters);
  EXPECT_TRUE(all.package.population().antialiased);
  const std::vector<uint8_t> codes(5, 9);
  sample.avatars[1]->avatar.smallest_extents = {.scale_m = 1e-4f, .codes = codes};
  expect_refused(sample.write().status(), "a population does not hold them", StatusCode::kMismatch);
}

TEST(PackageFilters, FitTheBodyWhoseTexelsTheyAre) {
  const BodySample body_sample;
  const Opened body = open_or_die(body_sample.write());
  FilteredAvatarSample sample;
  sample.avatar.body_hash = body.package.content_hash();
  EXPECT_TRUE(check_avatar_fits_body(sample.avatar, body.package).ok());
  sample.avatar.smallest_extents.codes = sample.avatar.smallest_extents.codes.first(4);
  expect_refused(check_avatar_fits_body(sample.avatar, body.package),
                 "smallest extents: 4 codes, the body has 5 texels", StatusCode::kMismatch);
}

}  // namespace
}  // namespace figurine::package_filters_test
