// Cameras for a dancing member of a shipped population: a close-up keeps the head in the middle and
// leaves the legs out, however the figure moves.
#include "samples/common/camera_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

namespace figurine::samples::camera_path_test {
namespace {

constexpr uint32_t kPelvis = 0, kHead = 15;

class CameraPath : public testing::Test {
 protected:
  void SetUp() override {
    const std::string samples = FIGURINE_SOURCE_DIR "/samples/";
    Result<Scene> scene = Scene::load({.avatars = {samples + "populations/nano.fgn#0"},
                                       .motions = {samples + "packages/dance.fgn"}});
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    scene_.emplace(std::move(*scene));
    renderer_ = Renderer::create({.threads = 1}).value();
    ASSERT_TRUE(scene_->add_to(*renderer_, Precision::kFloat32).ok());
  }

  std::vector<Camera> cameras(const CameraPathOptions& options) {
    const Result<std::vector<Camera>> path =
        make_camera_path(options, frames_, *scene_, *renderer_);
    EXPECT_TRUE(path.ok()) << path.status().message();
    return *path;
  }

  // Where a joint is in the picture of the frame: 0 in the middle, 1 at the border.
  float reach(const Camera& camera, size_t frame, uint32_t joint) {
    scene_->pose(frames_[frame]);
    const std::array<float, 3> p = scene_->joint_m(0, joint);
    float view[3];
    const auto& m = camera.view_from_world;
    for (int r = 0; r < 3; ++r)
      view[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    return std::max(std::fabs(camera.fx_px * view[0] / view[2]) / camera.cx_px,
                    std::fabs(camera.fy_px * view[1] / view[2]) / camera.cy_px);
  }

  const std::vector<uint32_t> frames_{20, 60, 100, 140};
  std::optional<Scene> scene_;
  std::unique_ptr<Renderer> renderer_;
};

TEST_F(CameraPath, HoldsTheWholeFigure) {
  const std::vector<Camera> path = cameras({.size = ImageSize{128, 128}});
  for (size_t i = 0; i < frames_.size(); ++i) {
    EXPECT_LT(reach(path[i], i, kHead), 0.95f) << i;
    EXPECT_LT(reach(path[i], i, kPelvis), 0.5f) << i;
  }
}

TEST_F(CameraPath, ACloseUpFollowsTheHead) {
  for (const Framing framing : {Framing::kBust, Framing::kHead}) {
    const std::vector<Camera> path = cameras({.size = ImageSize{128, 128}, .framing = framing});
    for (size_t i = 0; i < frames_.size(); ++i) {
      EXPECT_LT(reach(path[i], i, kHead), 0.7f) << i;
      EXPECT_GT(reach(path[i], i, kPelvis), 1.5f) << i;
    }
  }
}

TEST_F(CameraPath, AnOrbitIsAboutWhatIsFramed) {
  CameraPathOptions options{.size = ImageSize{128, 128}, .framing = Framing::kHead};
  options.camera.orbit = OrbitCamera{.azimuth_deg = 200, .distance_m = 2, .vertical_fov_deg = 20};
  const std::vector<Camera> path = cameras(options);
  for (size_t i = 0; i < frames_.size(); ++i) EXPECT_LT(reach(path[i], i, kHead), 0.5f) << i;
}

TEST_F(CameraPath, ACameraThatIsFixedFramesByItself) {
  CameraPathOptions options{.framing = Framing::kBust};
  options.camera.fixed = FileCamera{.width_px = 64, .height_px = 64};
  EXPECT_EQ(make_camera_path(options, frames_, *scene_, *renderer_).status().code(),
            StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace figurine::samples::camera_path_test
