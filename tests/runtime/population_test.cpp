// A population's member through the renderer: the same picture, to the bit, as an avatar package
// that holds the same weights.
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "formats/writer/package_writer.h"
#include "formats/writer/population_writer.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::population_test {
namespace {

using tests::make_renderer;
using tests::make_test_avatar;
using tests::make_test_body;
using tests::make_test_camera;
using tests::make_test_pose;
using tests::SyntheticAvatar;
using tests::SyntheticBody;
using tests::SyntheticPose;

constexpr uint32_t kWidth = 160, kHeight = 120;

std::vector<float> draw(const SyntheticBody& body, const std::vector<Avatar>& avatars) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  std::vector<FrameAvatar> seen;
  std::vector<SyntheticPose> poses;
  for (size_t i = 0; i < avatars.size(); ++i)
    poses.push_back(make_test_pose(body.body(), static_cast<uint32_t>(i + 1)));
  for (size_t i = 0; i < avatars.size(); ++i) {
    const Result<AvatarId> id = renderer->add_avatar(avatars[i], *body.package);
    FIG_CHECK(id.ok(), id.status().message().c_str());
    seen.push_back({.avatar = *id, .pose = poses[i].view()});
  }
  std::vector<float> pixels(size_t{kWidth} * kHeight * 4, -1);
  const Status status = renderer->render(
      {.camera = make_test_camera(kWidth, kHeight), .avatars = seen},
      {.pixels = pixels.data(), .stride_bytes = kWidth * 16, .format = PixelFormat::kRgbaF32});
  EXPECT_TRUE(status.ok()) << status.message();
  return pixels;
}

bool same(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

struct People {
  SyntheticBody body = make_test_body();
  std::vector<SyntheticAvatar> avatars;
  SyntheticAvatar initial = make_test_avatar(body, {.seed = 99});
  tests::AlignedBytes bytes;
  std::unique_ptr<Package> package;
  std::vector<std::vector<float>> storage;

  explicit People(DifferenceCoding coding) {
    NewPopulation population{
        .name = "people", .initial = initial.package->avatar().network, .coding = coding};
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      avatars.push_back(
          make_test_avatar(body, {.seed = seed, .name = "person " + std::to_string(seed)}));
      population.members.push_back({&avatars.back().package->avatar(),
                                    &avatars.back().package->provenance(), Split::kTrain});
    }
    for (size_t m = 0; m < 3; ++m) {  // the vector has grown
      population.members[m].avatar = &avatars[m].package->avatar();
      population.members[m].provenance = &avatars[m].package->provenance();
    }
    const Result<std::vector<std::byte>> written = write_population(population);
    FIG_CHECK(written.ok(), written.status().message().c_str());
    bytes = tests::AlignedBytes(*written);
    Result<Package> opened = Package::open(bytes.bytes(), "people");
    FIG_CHECK(opened.ok(), opened.status().message().c_str());
    package = std::make_unique<Package>(std::move(opened).value());
  }

  Avatar member(size_t m) {
    storage.emplace_back(member_floats(package->population()));
    return open_member(package->population(), m, storage.back());
  }
};

TEST(PopulationMember, RendersWhatAnAvatarPackageOfTheSameWeightsRenders) {
  for (const DifferenceCoding coding : {DifferenceCoding::kInt8, DifferenceCoding::kHalf}) {
    People people(coding);
    for (size_t m = 0; m < 3; ++m) {
      const Avatar member = people.member(m);
      const Result<std::vector<std::byte>> written =
          write_package(member, people.package->budget(), people.package->member_provenance(m));
      ASSERT_TRUE(written.ok()) << written.status().message();
      const tests::AlignedBytes bytes(*written);
      const Result<Package> alone = Package::open(bytes.bytes(), "alone");
      ASSERT_TRUE(alone.ok()) << alone.status().message();
      const std::vector<float> picture = draw(people.body, {member});
      EXPECT_TRUE(same(picture, draw(people.body, {alone->avatar()})));
      EXPECT_FALSE(same(picture, draw(people.body, {people.member((m + 1) % 3)})));
    }
  }
}

// A member is its map; the network, at half the texels' side, is everybody's.
TEST(PopulationMember, OfOneNetworkRendersItsMapOverThatNetwork) {
  const SyntheticBody body = make_test_body();
  const auto make = [&](uint64_t seed) {
    return make_test_avatar(body, {.seed = seed,
                                   .network_step = 2,
                                   .static_part = true,
                                   .name = "person " + std::to_string(seed)});
  };
  const SyntheticAvatar shared = make(1), first = make(2), second = make(3);
  const Avatar& network = shared.package->avatar();
  std::vector<Avatar> people;
  NewPopulation made{.name = "people",
                     .initial = network.network,
                     .shared = &network,
                     .coding = DifferenceCoding::kNone};
  for (const SyntheticAvatar* person : {&first, &second}) {
    Avatar& avatar = people.emplace_back(person->package->avatar());
    avatar.network = network.network;
  }
  for (const Avatar& avatar : people)
    made.members.push_back({&avatar, &shared.package->provenance(), Split::kTrain});
  const Result<std::vector<std::byte>> written = write_population(made);
  ASSERT_TRUE(written.ok()) << written.status().message();
  const tests::AlignedBytes bytes(*written);
  const Result<Package> package = Package::open(bytes.bytes(), "people");
  ASSERT_TRUE(package.ok()) << package.status().message();
  std::vector<float> storage(member_floats(package->population()));
  std::vector<float> before;
  for (size_t m = 0; m < 2; ++m) {
    const std::vector<float> picture = draw(body, {open_member(package->population(), m, storage)});
    EXPECT_TRUE(same(picture, draw(body, {people[m]})));
    EXPECT_FALSE(same(picture, before));
    before = picture;
  }
}

TEST(PopulationMember, SeveralStandInOneFrame) {
  People people(DifferenceCoding::kInt8);
  const std::vector<Avatar> all = {people.member(0), people.member(1), people.member(2)};
  EXPECT_FALSE(same(draw(people.body, all), draw(people.body, {all[0], all[1]})));
}

TEST(PopulationMember, IsInFloatAlone) {
  People people(DifferenceCoding::kInt8);
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Status status =
      renderer->add_avatar(people.member(0), *people.body.package, Precision::kFixedPoint).status();
  EXPECT_EQ(status.code(), StatusCode::kUnsupported);
  EXPECT_NE(status.message().find("in f32 alone, not in q8"), std::string::npos)
      << status.message();
}

TEST(PopulationMember, NeedsItsBody) {
  People people(DifferenceCoding::kInt8);
  const SyntheticBody other = make_test_body({.seed = 2});
  EXPECT_EQ(make_renderer()->add_avatar(people.member(0), *other.package).status().code(),
            StatusCode::kMismatch);
  EXPECT_EQ(make_renderer()->add_avatar(*people.package, *people.body.package).status().code(),
            StatusCode::kMismatch);
}

}  // namespace
}  // namespace figurine::population_test
