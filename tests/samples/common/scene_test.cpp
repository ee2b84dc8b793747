// Figures at their places: recorded frames and times say the same, a live source is what it is told
// to be, and a place turns and moves the root alone.
#include "samples/common/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "samples/program.h"

namespace figurine::samples::scene_test {
namespace {

class Scenes : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    packages_ = new tests::TestFolder;
    tests::write_test_packages(*packages_);
  }
  static void TearDownTestSuite() {
    delete packages_;
    packages_ = nullptr;
  }
  Scene load(std::vector<std::string> places = {}, size_t figures = 2) {
    SceneOptions options{.avatars = std::vector(figures, packages_->path("avatar.fgn")),
                         .motions = {packages_->path("motion.fgn")},
                         .places = std::move(places)};
    Result<Scene> scene = Scene::load(options);
    FIG_CHECK(scene.ok(), scene.status().message().c_str());
    return std::move(*scene);
  }

  static tests::TestFolder* packages_;
};
tests::TestFolder* Scenes::packages_ = nullptr;

// Everything that the figures' poses hold.
std::vector<float> numbers_of(std::span<const FrameAvatar> posed) {
  std::vector<float> numbers;
  for (const FrameAvatar& figure : posed) {
    numbers.insert(numbers.end(), figure.pose.root_translation_m.begin(),
                   figure.pose.root_translation_m.end());
    numbers.insert(numbers.end(), figure.pose.rotations.begin(), figure.pose.rotations.end());
  }
  return numbers;
}

TEST_F(Scenes, ATimeShowsTheFrameThatIsDue) {
  Scene scene = load({"0,0,40", "1,2"});
  ASSERT_EQ(scene.frame_count(), 12u);
  for (uint32_t frame = 0; frame < 30; ++frame) {
    const std::vector<float> recorded = numbers_of(scene.pose(frame % 12));
    const Result<std::span<const FrameAvatar>> live =
        scene.pose_at(frame / double(scene.frames_per_second()));
    ASSERT_TRUE(live.ok());
    EXPECT_EQ(numbers_of(*live), recorded) << frame;
  }
}

// Holds one pose until it ends.
class Ending final : public PoseSource {
 public:
  explicit Ending(const PoseView& pose) : pose_(pose) {}
  Result<PoseView> next(double time_s) override {
    if (time_s > 1) return Status(StatusCode::kIo, "stream: the sender has gone");
    return pose_;
  }

 private:
  PoseView pose_;
};

TEST_F(Scenes, JointsAreWhereThePlaceTurnsThem) {
  Scene here = load({"0,0"}, 1), turned = load({"3,1,90"}, 1);
  for (uint32_t frame : {0u, 7u}) {
    here.pose(frame), turned.pose(frame);
    const std::array<float, 3> root = here.joint_m(0, 0), head = here.joint_m(0, 2),
                               turned_head = turned.joint_m(0, 2);
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(root[k], here.root_m(0)[k], 1e-6);
    EXPECT_NE(head, root);
    // By 90 degrees about the vertical, +z becomes +x and +x becomes -z.
    EXPECT_NEAR(turned_head[0], 3 + head[2], 1e-5);
    EXPECT_NEAR(turned_head[1], head[1], 1e-5);
    EXPECT_NEAR(turned_head[2], 1 - head[0], 1e-5);
  }
}

TEST_F(Scenes, ASourceIsAskedAndItsEndIsTold) {
  Scene scene = load();
  const std::vector<float> before = numbers_of(scene.pose(0));
  std::vector<float> rotations(size_t(scene.body(1).package.body().joint_count()) * 4, 0.0f);
  for (size_t j = 0; j < rotations.size(); j += 4) rotations[j] = 1;
  scene.set_source(1, std::make_unique<Ending>(PoseView{{0, 0, 0}, rotations}));
  const Result<std::span<const FrameAvatar>> posed = scene.pose_at(0);
  ASSERT_TRUE(posed.ok());
  EXPECT_TRUE(std::ranges::equal((*posed)[1].pose.rotations, rotations));
  const std::vector<float> first = numbers_of(posed->first(1));
  EXPECT_TRUE(std::equal(first.begin(), first.end(), before.begin())) << "the other one walks on";
  const Status ended = scene.pose_at(1.5).status();
  EXPECT_EQ(ended.code(), StatusCode::kIo);
  EXPECT_EQ(ended.message(), packages_->path("avatar.fgn") + ": stream: the sender has gone");
  EXPECT_EQ(numbers_of(scene.pose(0)), before) << "frames are those of the motion still";
}

TEST_F(Scenes, AHeadingTurnsTheFigureAndItsWay) {
  Scene straight = load({"0,0"}, 1), turned = load({"3,-1,90"}, 1);
  for (const uint32_t frame : {0u, 7u}) {
    straight.pose(frame), turned.pose(frame);
    const std::array<float, 3> from = straight.root_m(0), to = turned.root_m(0);
    // A quarter turn to the left takes +z to +x and +x to -z.
    EXPECT_NEAR(to[0], from[2] + 3, 1e-5);
    EXPECT_NEAR(to[1], from[1], 1e-6);
    EXPECT_NEAR(to[2], -from[0] - 1, 1e-5);
    const float turn = turned.heading_deg(0) - straight.heading_deg(0);
    EXPECT_NEAR(turn < 0 ? turn + 360 : turn, 90, 1e-2);
  }
}

TEST_F(Scenes, SwayingIsAboutTheFirstFrame) {
  Scene scene = load({}, 1);
  const std::vector<float> still = numbers_of(scene.pose(0));
  const std::vector<float> one = numbers_of(scene.sway(0)), other = numbers_of(scene.sway(1));
  EXPECT_NE(one, other);
  for (size_t i = 0; i < still.size(); ++i) EXPECT_NEAR(one[i], still[i], 0.06) << i;
}

}  // namespace
}  // namespace figurine::samples::scene_test
