#include "toolchain/capture/camera_rings.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "gtest/gtest.h"
#include "toolchain/capture/sequence.h"
#include "toolchain/error.h"

namespace figurine::capture::camera_rings_test {
namespace {

// A box about as large as a person.
std::vector<Vec3> box() {
  std::vector<Vec3> points;
  for (float x : {-0.5f, 0.5f}) {
    for (float y : {0.0f, 1.8f}) {
      for (float z : {-0.3f, 0.3f}) points.push_back({x, y, z});
    }
  }
  return points;
}

TEST(CameraRings, HoldsEveryPointAndFillsTheImage) {
  for (uint32_t views : {1u, 4u, 24u, 48u}) {
    const std::vector<RingCamera> cameras = make_camera_rings({.views = views}, box());
    ASSERT_EQ(cameras.size(), views);
    float reach = 0;
    for (const RingCamera& entry : cameras) {
      const auto& m = entry.camera.view_from_world;
      for (const Vec3& p : box()) {
        const float z = m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11];
        const float x = entry.camera.fx_px * (m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3]) / z;
        const float y = entry.camera.fy_px * (m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7]) / z;
        reach = std::max<float>({reach, std::fabs(x) / 256, std::fabs(y) / 256});
      }
    }
    EXPECT_LE(reach, 0.9601f);
    EXPECT_GE(reach, 0.955f);
  }
}

TEST(CameraRings, NoCameraIsCalled41) {
  std::set<uint32_t> numbers;
  for (const RingCamera& entry : make_camera_rings({.views = 60}, box()))
    numbers.insert(entry.number);
  EXPECT_EQ(numbers.size(), 60u);
  EXPECT_EQ(numbers.count(41), 0u);
}

// The largest |image coordinate| of a point, 1 at the border.
float coordinate(const Camera& c, const Vec3& p) {
  const auto& m = c.view_from_world;
  const float z = m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11];
  return std::max(std::fabs(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3]) * c.fx_px / z / c.cx_px,
                  std::fabs(m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7]) * c.fy_px / z / c.cy_px);
}

TEST(CameraRings, ABustRingHoldsHeadsButForRarePoses) {
  // Heads of 100 poses, one of them crouching.
  std::vector<Vec3> heads;
  for (int pose = 0; pose < 100; ++pose) {
    const float sway = 0.001f * static_cast<float>(pose % 50), y = pose == 7 ? 0.9f : 1.45f;
    for (float up : {0.0f, 0.3f}) heads.push_back({0.2f - sway, y + up, sway});
  }
  const std::vector<RingCamera> cameras =
      make_camera_rings({.views = 4, .bust_views = 6}, box(), heads);
  ASSERT_EQ(cameras.size(), 10u);
  const std::vector<RingCamera> body = make_camera_rings({.views = 4}, box());
  size_t inside = 0;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const RingCamera& camera = cameras[c];
    EXPECT_EQ(camera.number, c + 1);
    EXPECT_EQ(camera.framing, c < 4 ? dataset::Framing::kBody : dataset::Framing::kBust);
    EXPECT_EQ(camera.name[0], c < 4 ? 'C' : 'B');
    EXPECT_EQ(camera.camera.fx_px, cameras[0].camera.fx_px) << "one lens for all";
    if (c < 4) {
      EXPECT_EQ(camera.camera.view_from_world, body[c].camera.view_from_world);
      continue;
    }
    for (const Vec3& p : heads) inside += coordinate(camera.camera, p) <= 0.9601f;
    EXPECT_GT(coordinate(camera.camera, {0, 0, 0}), 1.5f) << "feet are far outside";
  }
  EXPECT_GE(inside, 6 * 196u);
  EXPECT_LE(inside, 6 * 198u) << "crouching poses would need cameras from further away";
}

ports::MotionClip counting_clip(uint32_t frames) {
  ports::MotionClip clip;
  clip.name = "counting";
  clip.frame_count = frames;
  for (uint32_t f = 0; f < frames; ++f) {
    clip.root_translation_m.insert(clip.root_translation_m.end(),
                                   {1.0f, 0.001f * static_cast<float>(f), 2.0f});
    for (uint32_t j = 0; j < dataset::kSmplxJoints; ++j)
      clip.rotations.insert(clip.rotations.end(), {1, 0, 0, 0});
  }
  return clip;
}

TEST(Sequence, KeepsTheBlockFarFromEveryOtherPose) {
  const std::vector<CapturedPose> sequence = make_sequence({counting_clip(687)}, {});
  ASSERT_EQ(sequence.size(), 119u);
  uint32_t nearest = 1000, block = 0;
  for (const CapturedPose& a : sequence) {
    if (a.split != dataset::FrameSplit::kBlock) continue;
    ++block;
    for (const CapturedPose& b : sequence) {
      if (b.split != dataset::FrameSplit::kBlock)
        nearest =
            std::min(nearest, a.motion_frame > b.motion_frame ? a.motion_frame - b.motion_frame
                                                              : b.motion_frame - a.motion_frame);
    }
  }
  EXPECT_EQ(block, 7u);
  EXPECT_GE(nearest, kBlockDistance);
  EXPECT_EQ(sequence.back().motion_frame, 686u);
}

float widest_gap(std::vector<float> headings) {
  std::sort(headings.begin(), headings.end());
  float widest = headings.front() + 6.2831853f - headings.back();
  for (size_t i = 1; i < headings.size(); ++i)
    widest = std::max(widest, headings[i] - headings[i - 1]);
  return widest;
}

TEST(Sequence, HeadingsCoverTheCircle) {
  std::vector<float> training, held_out;
  for (const CapturedPose& pose : make_sequence({counting_clip(700)}, {})) {
    if (pose.split == dataset::FrameSplit::kTrain) training.push_back(pose.heading_rad);
    if (pose.split == dataset::FrameSplit::kInterleaved) held_out.push_back(pose.heading_rad);
  }
  EXPECT_LT(widest_gap(training), 0.20f)
      << "104 headings; evenly spread they would be 0.06 rad apart";
  EXPECT_LT(widest_gap(held_out), 1.6f) << "8 headings; evenly spread they would be 0.79 rad apart";
}

TEST(Sequence, PutsTheRootOverTheOrigin) {
  for (const CapturedPose& captured :
       make_sequence({counting_clip(200)}, {.root_rest_m = {0.01f, 0.9f, -0.02f}})) {
    EXPECT_EQ(captured.pose.root_translation_m[0], -0.01f);
    EXPECT_EQ(captured.pose.root_translation_m[2], 0.02f);
  }
}

TEST(Sequence, RefusesMoreFramesThanTheMotionHas) {
  EXPECT_THROW(make_sequence({counting_clip(50)}, {.frames = 51}), InputError);
}

TEST(Sequence, LaysMotionsEndToEnd) {
  const std::vector<CapturedPose> sequence =
      make_sequence({counting_clip(10), counting_clip(10)}, {.frames = 20});
  std::set<uint32_t> frames;
  for (size_t i = 0; i < 10; ++i) frames.insert(sequence[i].motion_frame);
  EXPECT_EQ(frames.size(), 10u);
  EXPECT_EQ(sequence[19].motion_frame, 9u);
}

}  // namespace
}  // namespace figurine::capture::camera_rings_test
