// Pictures of members: cameras hold what they were framed on, and a crew does all its work.
#include "toolchain/pictures/member_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <stdexcept>

#include "runtime/test_packages.h"
#include "toolchain/train/interrupt.h"

namespace figurine::pictures::member_pictures_test {

using measure::Picture;

namespace {

using tests::make_test_avatar;
using tests::make_test_body;

TEST(ShotRenderer, FramesWhatItLookedAt) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar avatar = make_test_avatar(body);
  const tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
  ShotRenderer renderer(*body.package, {{pose.root_translation_m, pose.rotations}},
                        {{.pose = 0, .azimuth_deg = 20, .subject = Subject::kGrounded}});
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

TEST(ShotRenderer, MovesEveryBustIntoTheMiddle) {
  const tests::SyntheticBody body = make_test_body({.joint_names = tests::kPersonJoints});
  const tests::SyntheticAvatar one = make_test_avatar(body, {.shape = {0, 0}}),
                               other = make_test_avatar(body, {.shape = {5, -4}, .seed = 2});
  const tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
  ShotRenderer renderer(*body.package, {{pose.root_translation_m, pose.rotations}},
                        {{.pose = 0, .azimuth_deg = 20, .subject = Subject::kPlaced},
                         {.pose = 0, .azimuth_deg = 20, .subject = Subject::kBust}});
  const std::vector<Extent> first = renderer.look(one.package->avatar()),
                            second = renderer.look(other.package->avatar());
  for (const std::vector<Extent>& person : {first, second}) {
    const Extent &whole = person[0], &bust = person[1];
    EXPECT_NEAR(0.5f * (bust.top + bust.bottom), 0, 0.01f);
    EXPECT_NEAR(0.5f * (bust.left + bust.right), 0, 0.01f);
    EXPECT_LT(bust.bottom - bust.top, 0.8f * (whole.bottom - whole.top));
  }
  renderer.frame(1, first[1], 40, 40, 0.1f);
  const Picture picture = renderer.draw(one.package->avatar(), 1, 2).front();
  EXPECT_GT(picture.rgba[4 * (20 * 40 + 20) + 3], 128) << "the middle is covered";
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
}  // namespace figurine::pictures::member_pictures_test
