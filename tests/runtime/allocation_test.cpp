// A frame allocates nothing after the first, XNNPACK and the thread pool included; what the
// renderer says it holds is about what it took; and the shipped avatar takes, in the precision
// that a device runs it in, no more than its package says.
//
// This program counts its allocations (counted_malloc.h); under a sanitizer it cannot.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "figurine.h"
#include "runtime/counted_malloc.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"
#include "tests/emulated.h"

namespace figurine {
namespace {

using namespace tests;

TEST(Allocation, TheCounterSeesNewAndMalloc) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const uint64_t before = g_allocations;
  void* volatile block = std::malloc(10);
  std::free(block);
  int* volatile number = new int(3);
  delete number;
  EXPECT_EQ(g_allocations - before, 2u);
}

void expect_no_allocations(uint32_t threads, Held held, const Approximation& approximation = {},
                           bool keep_to_known = false) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  const SyntheticAvatar avatar =
                            make_test_avatar(body, {.held = held, .known_poses = keep_to_known}),
                        other = make_test_avatar(
                            body, {.sh_degree = 2, .seed = 3, .held = Held::kFixedPoint}),
                        composed = make_test_avatar(
                            body, {.held = held, .network_step = 2, .static_part = true});
  const std::unique_ptr<Renderer> renderer = make_renderer(threads);
  const Result<AvatarId> a = renderer->add_avatar(*avatar.package, *body.package),
                         b = renderer->add_avatar(*other.package, *body.package),
                         c = renderer->add_avatar(*composed.package, *body.package);
  ASSERT_TRUE(a.ok() && b.ok() && c.ok());
  const Scene scene = make_random_scene(5000, 1, 4);
  const GaussianView view = scene.view();
  constexpr uint32_t kFrames = tests::kEmulated ? 4 : 12;
  std::vector<SyntheticPose> poses;
  std::vector<Camera> cameras;
  for (uint32_t frame = 0; frame < kFrames; ++frame) {
    poses.push_back(make_test_pose(body.body(), frame));
    cameras.push_back(make_test_camera(200, 160, 30.0f * static_cast<float>(frame)));
    // Closer and closer: the pairs of later frames outgrow those of the first.
    cameras.back().fx_px *= 1 + 0.1f * static_cast<float>(frame);
    cameras.back().fy_px *= 1 + 0.1f * static_cast<float>(frame);
  }
  std::vector<uint8_t> rgba(200 * 160 * 4);
  uint64_t after_first = 0, first_pairs = 0, largest_pairs = 0, pulled = 0;
  for (uint32_t frame = 0; frame < kFrames; ++frame) {
    const FrameAvatar seen[] = {
        {.avatar = *a, .pose = poses[frame].view(), .keep_to_known = keep_to_known},
        {.avatar = *b, .pose = poses[kFrames - 1 - frame].view()},
        {.avatar = *c, .pose = poses[frame].view()}};
    ASSERT_TRUE(renderer
                    ->render({.camera = cameras[frame],
                              .avatars = seen,
                              .gaussians = {&view, 1},
                              .approximation = approximation},
                             {.pixels = rgba.data(), .stride_bytes = 800})
                    .ok());
    ASSERT_TRUE(renderer->pose_rarity(*a, poses[frame].view()).ok());
    pulled += renderer->statistics().pulled_poses;
    if (frame == 0) after_first = g_allocations;
    (frame == 0 ? first_pairs : largest_pairs) =
        std::max(largest_pairs, renderer->statistics().pairs);
  }
  EXPECT_EQ(g_allocations - after_first, 0u) << threads << " threads";
  EXPECT_GT(largest_pairs, first_pairs);
  EXPECT_EQ(pulled > 0, keep_to_known);
}

TEST(Allocation, NoFrameAllocatesAfterTheFirst) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  for (const Held held : {Held::kFloat32, Held::kFixedPoint}) {
    for (const uint32_t threads : {1u, 2u}) expect_no_allocations(threads, held);
    expect_no_allocations(1, held, {.network_interval = 2, .averted_above = 0.2f});
    expect_no_allocations(1, held, {}, true);
  }
}

// The 101st set's name in a message no longer fits into a short string: it must be made on errors
// alone.
TEST(Allocation, ManySetsAndAvatarsAllocateNothingEither) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const SyntheticBody body = make_test_body({});
  const SyntheticAvatar avatar = make_test_avatar(body, {});
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body.package);
  ASSERT_TRUE(id.ok());
  const Scene scene = make_random_scene(10, 1, 4);
  const std::vector<GaussianView> sets(101, scene.view());
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  const std::vector<FrameAvatar> seen(101, {.avatar = *id, .pose = pose.view()});
  std::vector<uint8_t> rgba(32 * 32 * 4);
  const Frame frame{.camera = make_test_camera(32, 32), .avatars = seen, .gaussians = sets};
  const ImageTarget target{.pixels = rgba.data(), .stride_bytes = 128};
  ASSERT_TRUE(renderer->render(frame, target).ok());
  const uint64_t after_first = g_allocations;
  ASSERT_TRUE(renderer->render(frame, target).ok());
  EXPECT_EQ(g_allocations - after_first, 0u);
}

void expect_memory_is_what_was_taken(const SyntheticAvatarOptions& form) {
  const SyntheticBody body = make_test_body({.uv_size = 128});
  SyntheticAvatarOptions edge = form;
  edge.channels = 32, edge.fourier_octaves = 5;
  const SyntheticAvatar avatar = make_test_avatar(body, edge);
  const SyntheticPose pose = make_test_pose(body.body(), 1);
  std::vector<uint8_t> rgba(512 * 512 * 4);
  {
    make_renderer();
  }  // XNNPACK's own tables, once a process
  const int64_t before = g_held_bytes;
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body.package);
  ASSERT_TRUE(id.ok());
  const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
  ASSERT_TRUE(renderer
                  ->render({.camera = make_test_camera(512, 512), .avatars = seen},
                           {.pixels = rgba.data(), .stride_bytes = 2048})
                  .ok());
  const double taken = static_cast<double>(g_held_bytes - before),
               said = static_cast<double>(renderer->memory_bytes());
  std::printf("edge-sized renderer: says %.2f MB, holds %.2f MB\n", said * 1e-6, taken * 1e-6);
  EXPECT_NEAR(said / taken, 1, 0.2);
}

// By content: packages read twice and storage used again are what they hold.
TEST(Allocation, TheInterfaceInCAllocatesNothingEither) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const SyntheticBody test_body = make_test_body({});
  const SyntheticAvatar test_avatar = make_test_avatar(test_body, {});
  const auto open = [](std::span<const std::byte> bytes) {
    fig_package package{};
    EXPECT_EQ(fig_package_open(bytes.data(), bytes.size(), nullptr, &package), FIG_OK);
    return package;
  };
  const fig_package body = open(test_body.bytes.bytes()), avatar = open(test_avatar.bytes.bytes());
  fig_renderer renderer{};
  ASSERT_EQ(fig_renderer_create(nullptr, &renderer), FIG_OK);
  fig_pose pose = fig_default_pose();
  fig_camera camera = fig_default_camera();
  ASSERT_EQ(fig_package_golden_view(avatar, 0, &camera, &pose), FIG_OK);
  std::vector<fig_frame_avatar> seen(101, fig_default_frame_avatar());
  ASSERT_EQ(fig_renderer_add_avatar(renderer, avatar, 0, body, nullptr, &seen[0].avatar), FIG_OK);
  for (fig_frame_avatar& one : seen) one.avatar = seen[0].avatar, one.pose = &pose;
  fig_frame frame = fig_default_frame();
  frame.camera = &camera, frame.avatars = seen.data(), frame.avatar_count = seen.size();
  std::vector<uint8_t> rgba(size_t{4} * camera.width_px * camera.height_px);
  fig_image image = fig_default_image();
  image.pixels = rgba.data(), image.stride_bytes = size_t{4} * camera.width_px;
  ASSERT_EQ(fig_renderer_render(renderer, &frame, &image), FIG_OK) << fig_last_message();
  const uint64_t after_first = g_allocations;
  ASSERT_EQ(fig_renderer_render(renderer, &frame, &image), FIG_OK);
  EXPECT_EQ(g_allocations - after_first, 0u);
  EXPECT_EQ(fig_renderer_destroy(renderer), FIG_OK);
  EXPECT_EQ(fig_package_close(avatar), FIG_OK);
  EXPECT_EQ(fig_package_close(body), FIG_OK);
}

TEST(Allocation, WhatIsAddedAgainIsHeldOnce) {
  const SyntheticBody body = make_test_body({.uv_size = 32});
  for (const Held held : {Held::kFloat32, Held::kFixedPoint}) {
    const SyntheticAvatar avatar = make_test_avatar(body, {.held = held}),
                          copy = make_test_avatar(body, {.held = held}),
                          other = make_test_avatar(body, {.seed = 5, .held = held}),
                          composed = make_test_avatar(body, {.held = held, .static_part = true});
    const std::unique_ptr<Renderer> renderer = make_renderer();
    const auto add = [&](const SyntheticAvatar& added) {
      const Result<AvatarId> id = renderer->add_avatar(*added.package, *body.package);
      EXPECT_TRUE(id.ok());
      return *id;
    };
    const AvatarId first = add(avatar);
    const uint64_t one = renderer->memory_bytes();
    const int64_t before = g_held_bytes;
    std::vector<AvatarId> crowd;
    for (int i = 0; i < 200; ++i) crowd.push_back(add(i % 2 == 0 ? avatar : copy));
    EXPECT_LT(renderer->memory_bytes(), 2 * one) << "200 times " << one << " bytes";
    EXPECT_LT(g_held_bytes - before, static_cast<int64_t>(one));
    EXPECT_NE(crowd.front(), first);

    const AvatarId different = add(other);
    EXPECT_GT(renderer->memory_bytes(), 3 * one / 2);
    const SyntheticPose pose = make_test_pose(body.body(), 1);
    const auto opacities = [&](AvatarId id) {
      const Result<GaussianView> posed = renderer->pose_avatar(id, pose.view());
      EXPECT_TRUE(posed.ok());
      return std::vector<float>(posed->opacity.begin(), posed->opacity.end());
    };
    EXPECT_EQ(opacities(crowd.back()), opacities(first));
    EXPECT_NE(opacities(different), opacities(first));
    // The same weights and a static part, which says nothing of opacities.
    const auto first_place = [&](AvatarId id) {
      const Result<GaussianView> posed = renderer->pose_avatar(id, pose.view());
      EXPECT_TRUE(posed.ok());
      return posed->position_m[0];
    };
    EXPECT_NE(first_place(add(composed)), first_place(first));
  }
}

TEST(Allocation, MemoryBytesIsWhatWasTaken) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  if (!tests::kEmulated)  // half a minute of emulated float
    expect_memory_is_what_was_taken({.held = Held::kFloat32});
  expect_memory_is_what_was_taken({.held = Held::kFixedPoint});
  expect_memory_is_what_was_taken(
      {.held = Held::kFixedPoint, .network_step = 2, .static_part = true});
  expect_memory_is_what_was_taken({.network_step = 0, .static_part = true});
}

AlignedBytes read_shipped(const char* name) {
  std::ifstream file(std::string(FIGURINE_SOURCE_DIR "/samples/packages/") + name,
                     std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  return AlignedBytes(std::as_bytes(std::span(bytes)));
}

// From opening to frames from all around and close by, everything that was allocated at any moment,
// the image and the packages' bytes apart.
TEST(Allocation, TheShippedAvatarKeepsThePeakThatItsPackageDeclares) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const AlignedBytes body_bytes = read_shipped("body-128.fgn"),
                     avatar_bytes = read_shipped("person.fgn");
  {
    make_renderer();
  }  // XNNPACK's own tables, once a process
  for (const Precision precision : {Precision::kFixedPoint, Precision::kFloat32}) {
    if (tests::kEmulated && precision == Precision::kFloat32) continue;  // slow
    for (const uint32_t threads : {1u, 2u}) {
      std::vector<uint8_t> rgba(512 * 512 * 4);
      const int64_t before = g_held_bytes;
      g_most_held_bytes = before;
      const Result<Package> body = Package::open(body_bytes.bytes(), "body"),
                            avatar = Package::open(avatar_bytes.bytes(), "avatar",
                                                   OpenOptions::for_drawing(precision));
      ASSERT_TRUE(body.ok() && avatar.ok());
      const int64_t opened = g_most_held_bytes - before;
      const std::unique_ptr<Renderer> renderer = make_renderer(threads);
      const Result<AvatarId> id = renderer->add_avatar(*avatar, *body, precision);
      ASSERT_TRUE(id.ok()) << id.status().message();
      const int64_t added = g_most_held_bytes - before;
      const GoldenFrame& golden = avatar->avatar().golden;
      const FrameAvatar seen[] = {
          {.avatar = *id, .pose = {golden.root_translation_m, golden.rotations}}};
      const auto draw = [&](const Camera& camera) {
        ASSERT_TRUE(
            renderer
                ->render({.camera = camera, .avatars = seen},
                         {.pixels = rgba.data(), .stride_bytes = size_t{4} * camera.width_px})
                .ok());
      };
      draw(golden.camera);
      const int64_t golden_frame = g_most_held_bytes - before;
      for (uint32_t i = 0; i < (tests::kEmulated ? 2u : 12u); ++i) {
        Camera camera = make_test_camera(512, 512, 30.0f * static_cast<float>(i));
        camera.fx_px *= 1 + 0.2f * static_cast<float>(i);
        camera.fy_px *= 1 + 0.2f * static_cast<float>(i);
        draw(camera);
      }
      const int64_t most = g_most_held_bytes - before,
                    declared = static_cast<int64_t>(avatar->budget().peak_memory_bytes);
      std::printf(
          "%s, %u threads: %.2f MB to open, %.2f to add, %.2f for the golden frame, %.2f "
          "at most; declared %.2f, said %.2f\n",
          to_string(precision), threads, static_cast<double>(opened) * 1e-6,
          static_cast<double>(added) * 1e-6, static_cast<double>(golden_frame) * 1e-6,
          static_cast<double>(most) * 1e-6, static_cast<double>(declared) * 1e-6,
          static_cast<double>(renderer->memory_bytes()) * 1e-6);
      // In floats a tenth more than it says: it was packed by a renderer that took less, and its
      // next packing declares anew. No more than that.
      EXPECT_LE(most, precision == Precision::kFixedPoint ? declared : declared + declared / 8);
    }
  }
}

}  // namespace
}  // namespace figurine
