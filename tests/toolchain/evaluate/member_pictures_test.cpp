// Pictures of members that are compared: the fast comparison is the plain one, cameras hold what
// they were framed on, a mixture's ends are the members themselves.
#include "toolchain/evaluate/member_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <stdexcept>

#include "runtime/test_packages.h"
#include "toolchain/evaluate/member_span.h"
#include "toolchain/train/interrupt.h"

namespace figurine::evaluate {
namespace {

using tests::make_test_avatar;
using tests::make_test_body;

Picture random_picture(tests::Random& random) {
  Picture picture{12, 10, {}};
  for (size_t i = 0; i < 120; ++i) {
    const auto alpha =
        static_cast<uint8_t>(random.uniform(0, 1) < 0.5f ? 0 : random.uniform(0, 256));
    for (int c = 0; c < 3; ++c)
      picture.rgba.push_back(static_cast<uint8_t>(random.uniform(0, float(alpha) + 1)));
    picture.rgba.push_back(alpha);
  }
  return picture;
}

TEST(UnionError, CountsBothForegroundsOverGrey) {
  Picture a{3, 1, {255, 255, 255, 255, 0, 0, 0, 0, 0, 0, 0, 100}};
  const Picture b{3, 1, {255, 255, 255, 255, 255, 255, 255, 255, 90, 0, 0, 100}};
  const SquaredError error = union_error(
      a, b);  // the first is equal, the second white against grey, the third nobody's foreground
  EXPECT_EQ(error.count, 6u);
  EXPECT_NEAR(error.sum, 3 * 0.25, 1e-12);
  EXPECT_EQ(union_error(b, a).sum, error.sum);
  EXPECT_EQ(union_error(a, a).sum, 0);
}

TEST(ComparedPictures, EqualThePlainComparison) {
  tests::Random random(3);
  std::vector<std::vector<Picture>> members(4);
  for (auto& own : members) own = {random_picture(random), random_picture(random)};
  const ComparedPictures compared(members);
  for (size_t a = 0; a < members.size(); ++a) {
    for (size_t b = 0; b < members.size(); ++b) {
      const SquaredError wanted = union_error(members[a], members[b]), found = compared.error(a, b);
      EXPECT_EQ(found.count, wanted.count);
      EXPECT_NEAR(found.sum, wanted.sum, 1e-12 * (1 + wanted.sum));
    }
  }
}

TEST(ShotRenderer, FramesWhatItLookedAt) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar avatar = make_test_avatar(body);
  const tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
  ShotRenderer renderer(*body.package, {{pose.root_translation_m, pose.rotations}},
                        {{.pose = 0, .azimuth_deg = 20, .grounded = true}});
  renderer.frame(0, renderer.look(avatar.package->avatar())[0], 60, 90, 0.2f);
  const std::vector<Picture> pictures = renderer.draw(avatar.package->avatar(), 0, 1);
  ASSERT_EQ(pictures.size(), 1u);
  EXPECT_EQ(pictures[0].width_px, 60u);
  EXPECT_EQ(pictures[0].height_px, 90u);
  double x = 0, y = 0, count = 0;
  for (size_t i = 0; i < 60 * 90; ++i) {
    const double alpha = pictures[0].rgba[4 * i + 3];
    x += alpha * (double(i % 60) + 0.5), y += alpha * (double(i / 60) + 0.5), count += alpha;
  }
  ASSERT_GT(count, 0);
  EXPECT_NEAR(x / count, 30, 10);
  EXPECT_NEAR(y / count, 45, 15);
}

TEST(Mix, EndsAreTheMembers) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar one = make_test_avatar(body, {.shape = {1, 0}, .seed = 1}),
                               two = make_test_avatar(body, {.shape = {0, 3}, .seed = 2});
  const Avatar &a = one.package->avatar(), &b = two.package->avatar();
  std::vector<float> storage;
  EXPECT_TRUE(std::ranges::equal(mix(a, b, 0, storage).network.layers[0].weights,
                                 a.network.layers[0].weights));
  EXPECT_TRUE(std::ranges::equal(mix(a, b, 1, storage).network.layers[0].weights,
                                 b.network.layers[0].weights));
  const Avatar middle = mix(a, b, 0.5, storage);
  EXPECT_FLOAT_EQ(middle.network.layers[0].bias[0],
                  0.5f * (a.network.layers[0].bias[0] + b.network.layers[0].bias[0]));
  EXPECT_FLOAT_EQ(middle.shape[0], 0.5f);
  EXPECT_FLOAT_EQ(middle.shape[1], 1.5f);
}

TEST(Crew, DoesEveryPieceAndPassesOnWhatIsThrown) {
  const Crew crew(2, true);
  std::vector<int> done(37, 0);
  crew.run("test", done.size(), [&](size_t i) { ++done[i]; });
  EXPECT_EQ(std::count(done.begin(), done.end(), 1), 37);
  EXPECT_THROW(crew.run("test", 5,
                        [](size_t i) {
                          if (i == 3) throw std::runtime_error("third");
                        }),
               std::runtime_error);
  std::raise(SIGINT);
  EXPECT_THROW(crew.run("test", 5, [](size_t) {}), train::Interrupted);
}

}  // namespace
}  // namespace figurine::evaluate
