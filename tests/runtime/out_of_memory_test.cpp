// Every allocation of the device half fails once: opening packages of every kind, renderers,
// avatars, frames, samplers, in C++ and in C, XNNPACK and the threads included. The answer is a
// result that holds or kOutOfMemory in one line; nothing is leaked, and what was there before draws
// what it drew. Then the same with a heap that ends after so many bytes, for all sizes of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "figurine.h"
#include "figurine/avatar_sampler.h"
#include "figurine/detail/memory_reserve.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "runtime/counted_malloc.h"
#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::out_of_memory_test {
namespace {

using namespace tests;

const std::string kName = "a package of some name";  // made before anything fails
constexpr uint32_t kWidth = 48, kHeight = 32;

// As many small reserves as an operation may hold at once are there and kept again.
void keep_reserves() {
  const MemoryReserve a, b, c, d, e, f;
  ASSERT_TRUE(a.held() && b.held() && c.held() && d.held() && e.held() && f.held());
}

// The part of an operation in which allocations fail: between begin() and end(), or its return.
struct Window {
  std::function<void()> begin, end;
};

class FailingRuns {
 public:
  using Operation = std::function<Status(const Window& window)>;

  FailingRuns(const char* name, Operation operation, std::function<void()> still_works)
      : name_(name), operation_(std::move(operation)), still_works_(std::move(still_works)) {}

  void run() {
    int64_t most = 0;
    for (int warm = 0; warm < 2; ++warm) {  // what is made once a process
      keep_reserves();
      int64_t before = 0;
      const auto begin = [&] { g_most_held_bytes = before = g_held_bytes; };
      const auto end = [&] { most = g_most_held_bytes - before; };
      const Status status = operation_({begin, end});
      ASSERT_TRUE(status.ok()) << name_ << ": " << status.message();
    }
    fail_each();
    if (!testing::Test::HasFatalFailure()) end_heap(most);
    std::printf("%-28s %5zu allocations, %4zu refused; heaps %4zu, %4zu refused\n", name_, each_,
                each_refused_, heaps_, heaps_refused_);
  }

 private:
  void fail_each() {
    for (uint64_t n = 1;; ++n, ++each_) {
      ASSERT_LT(n, 20000u) << name_;
      bool refused = false;
      const uint64_t failed =
          once("allocation " + std::to_string(n), [&] { fail_allocation(n); }, refused);
      if (failed == 0) break;
      each_refused_ += refused ? 1 : 0;
    }
    EXPECT_GT(each_, 0u) << name_ << ": allocates nothing";
  }

  void end_heap(int64_t most) {
    const int64_t step = std::max<int64_t>(most / 150, 32);
    for (int64_t room = 0; room < most; room += step, ++heaps_) {
      bool refused = false;
      once(
          "a heap of " + std::to_string(room) + " bytes more",
          [&] { limit_held_bytes(g_held_bytes + room); }, refused);
      heaps_refused_ += refused ? 1 : 0;
    }
  }

  // How many allocations failed.
  uint64_t once(const std::string& what, const std::function<void()>& begin, bool& refused) {
    keep_reserves();
    const int64_t held = g_held_bytes;
    uint64_t failed = 0;
    bool ended = false;
    const auto end = [&] {
      if (!ended) failed = stop_failing();
      ended = true;
    };
    {
      const Status status = operation_({begin, end});
      end();
      refused = !status.ok();
      if (refused) {
        EXPECT_EQ(status.code(), StatusCode::kOutOfMemory)
            << name_ << ", " << what << ": " << status.message();
        EXPECT_EQ(status.message().find('\n'), std::string::npos) << status.message();
        EXPECT_NE(status.message().find("no memory"), std::string::npos) << status.message();
      }
    }
    keep_reserves();
    EXPECT_EQ(g_held_bytes - held, 0) << name_ << ", " << what << ": leaks";
    still_works_();
    return failed;
  }

  const char* name_;
  Operation operation_;
  std::function<void()> still_works_;
  size_t each_ = 0, each_refused_ = 0, heaps_ = 0, heaps_refused_ = 0;
};

void fail_all(
    const char* name, FailingRuns::Operation operation, std::function<void()> still_works = [] {}) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  FailingRuns(name, std::move(operation), std::move(still_works)).run();
}

// ---- Reserves -----------------------------------------------------------------------------------

TEST(MemoryReserve, IsGivenUpForAnAllocationThatFails) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const std::new_handler before = std::get_new_handler();
  {
    const MemoryReserve outer, inner;
    EXPECT_TRUE(outer.held() && inner.held());
    fail_allocation(1);
    std::vector<int> list(100);
    EXPECT_EQ(stop_failing(), 1u);
    EXPECT_TRUE(outer.held());
    EXPECT_FALSE(inner.held());
    fail_allocation(1);
    EXPECT_EQ(try_allocate(100, 64), nullptr) << "no reserve is for what may fail";
    stop_failing();
    EXPECT_TRUE(outer.held());
  }
  EXPECT_EQ(std::get_new_handler(), before);
}

uint64_t g_asked_of_host = 0;

TEST(MemoryReserve, LeavesOtherThreadsToTheirHandler) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const std::new_handler before = std::set_new_handler([] { ++g_asked_of_host; });
  {
    const MemoryReserve reserve;
    std::thread([] {
      fail_allocation(1);
      int* volatile number = new int(3);
      delete number;
      stop_failing();
    }).join();
    EXPECT_EQ(g_asked_of_host, 1u);
    EXPECT_TRUE(reserve.held());
  }
  std::set_new_handler(before);
}

TEST(MemoryReserve, WithoutAnyTheExceptionIsTheHosts) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  const MemoryReserve reserve;
  bool caught = false;
  std::thread([&] {
    fail_allocation(1);
    try {
      std::vector<int> list(100);
    } catch (const std::bad_alloc&) {
      caught = true;
    }
    stop_failing();
  }).join();
  EXPECT_TRUE(caught);
}

// ---- C++ ----------------------------------------------------------------------------------------

TEST(OutOfMemory, PackagesOfEveryKind) {
  for (const samples::SampleKind kind : samples::kSampleKinds) {
    const Result<std::vector<std::byte>> written = samples::write_sample(kind);
    ASSERT_TRUE(written.ok());
    const tests::AlignedBytes bytes{std::span<const std::byte>(*written)};
    fail_all(samples::to_string(kind).c_str(), [&](const Window& window) {
      window.begin();
      const Result<Package> opened = Package::open(bytes.bytes(), kName);
      window.end();
      std::string reason;
      if (opened.ok()) {
        EXPECT_TRUE(samples::exercise(*opened, reason)) << reason;
      }
      return opened.status();
    });
  }
}

// A package that is refused is refused for what is wrong with it, or for lack of memory.
TEST(OutOfMemory, TheRefusalOfADamagedPackage) {
  if (!FIG_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc";
  Result<std::vector<std::byte>> written = samples::write_sample(samples::SampleKind::kAvatar);
  ASSERT_TRUE(written.ok());
  written->back() ^= std::byte{1};
  const tests::AlignedBytes bytes{std::span<const std::byte>(*written)};
  for (uint64_t n = 1, failed = 1; failed > 0; ++n) {
    keep_reserves();
    fail_allocation(n);
    const Result<Package> opened = Package::open(bytes.bytes(), kName);
    failed = stop_failing();
    const Status& status = opened.status();
    EXPECT_TRUE(status.code() == StatusCode::kCorrupt || status.code() == StatusCode::kOutOfMemory)
        << status.message();
  }
}

class OutOfMemoryOfRenderers : public testing::TestWithParam<Held> {
 protected:
  Status draw(Renderer& renderer, AvatarId id, uint32_t frame) {
    const FrameAvatar seen[] = {{.avatar = id, .pose = poses_[frame].view()}};
    return renderer.render({.camera = make_test_camera(kWidth, kHeight), .avatars = seen},
                           {.pixels = pixels_.data(), .stride_bytes = size_t{4} * kWidth});
  }
  std::vector<uint8_t> picture(Renderer& renderer, AvatarId id, uint32_t frame) {
    const Status status = draw(renderer, id, frame);
    EXPECT_TRUE(status.ok()) << status.message();
    return pixels_;
  }
  Result<AvatarId> add(Renderer& renderer, const SyntheticAvatar& avatar) {
    return renderer.add_avatar(*avatar.package, *body_.package);
  }

  const SyntheticBody body_ = make_test_body({.uv_size = 32});
  const SyntheticAvatar avatar_ = make_test_avatar(body_, {.held = GetParam()}),
                        composed_ = make_test_avatar(body_, {.seed = 4,
                                                             .held = GetParam(),
                                                             .network_step = 2,
                                                             .static_part = true,
                                                             .filters = true});
  // Made before anything fails.
  const SyntheticPose poses_[3] = {make_test_pose(body_.body(), 0), make_test_pose(body_.body(), 1),
                                   make_test_pose(body_.body(), 2)};
  std::vector<uint8_t> pixels_ = std::vector<uint8_t>(size_t{4} * kWidth * kHeight);
};

TEST_P(OutOfMemoryOfRenderers, Creating) {
  for (const uint32_t threads : {1u, 2u}) {
    fail_all("create a renderer", [&](const Window& window) {
      window.begin();
      const auto created = Renderer::create({.threads = threads, .allow_oversubscription = true});
      window.end();
      return created.status();
    });
  }
}

TEST_P(OutOfMemoryOfRenderers, AddingAndFramesBesideAnAvatarThatIsThere) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Result<AvatarId> there = add(*renderer, avatar_);
  ASSERT_TRUE(there.ok());
  const std::vector<uint8_t> before = picture(*renderer, *there, 1);
  const auto still_works = [&] { EXPECT_EQ(picture(*renderer, *there, 1), before); };
  // One whose arrays are as large as they get: what grows while frames fail is no leak.
  {
    const Result<AvatarId> warm = add(*renderer, composed_);
    ASSERT_TRUE(warm.ok() && draw(*renderer, *warm, 2).ok());
    ASSERT_TRUE(renderer->pose_avatar(*warm, make_test_pose(body_.body(), 2).view()).ok());
    ASSERT_TRUE(renderer->remove_avatar(*warm).ok());
  }
  fail_all(
      "add an avatar",
      [&](const Window& window) {
        window.begin();
        const Result<AvatarId> added = add(*renderer, composed_);
        window.end();
        if (!added.ok()) return added.status();
        EXPECT_TRUE(draw(*renderer, *added, 2).ok());
        return renderer->remove_avatar(*added);
      },
      still_works);
  const std::vector<uint8_t> second = [&] {
    const std::unique_ptr<Renderer> other = make_renderer();
    const Result<AvatarId> id = add(*other, composed_);
    EXPECT_TRUE(id.ok());
    return picture(*other, *id, 2);
  }();
  fail_all(
      "first and second frame",
      [&](const Window& window) {
        const std::unique_ptr<Renderer> fresh = make_renderer();
        const Result<AvatarId> id = add(*fresh, composed_);
        EXPECT_TRUE(id.ok());
        window.begin();
        Status then = draw(*fresh, *id, 1);
        if (then.ok()) then = draw(*fresh, *id, 2);  // moved: a copy would allocate
        window.end();
        EXPECT_EQ(picture(*fresh, *id, 2), second);  // whether the frames failed or not
        return then;
      },
      still_works);
  fail_all(
      "pose an avatar",
      [&](const Window& window) {
        const std::unique_ptr<Renderer> fresh = make_renderer();
        const Result<AvatarId> id = add(*fresh, composed_);
        EXPECT_TRUE(id.ok());
        const SyntheticPose pose = make_test_pose(body_.body(), 2);
        window.begin();
        const Status status = fresh->pose_avatar(*id, pose.view()).status();
        window.end();
        EXPECT_EQ(picture(*fresh, *id, 2), second);
        return status;
      },
      still_works);
}

INSTANTIATE_TEST_SUITE_P(OutOfMemory, OutOfMemoryOfRenderers,
                         testing::Values(Held::kFloat32, Held::kFixedPoint), [](const auto& held) {
                           return held.param == Held::kFloat32 ? "Float" : "FixedPoint";
                         });

TEST(OutOfMemory, ASceneOfGaussians) {
  const Scene scene = make_random_scene(2000, 1, 4);
  const GaussianView view = scene.view();
  const Frame frame{.camera = front_camera(kWidth, kHeight, 40), .gaussians = {&view, 1}};
  std::vector<uint8_t> pixels(size_t{4} * kWidth * kHeight);
  const ImageTarget target{.pixels = pixels.data(), .stride_bytes = size_t{4} * kWidth};
  for (const uint32_t threads : {1u, 2u}) {
    ASSERT_TRUE(make_renderer(threads)->render(frame, target).ok());
    const std::vector<uint8_t> expected = pixels;
    fail_all("a scene of Gaussians", [&](const Window& window) {
      const std::unique_ptr<Renderer> renderer = make_renderer(threads);
      window.begin();
      const Status first = renderer->render(frame, target);
      window.end();
      const Status then = renderer->render(frame, target);
      EXPECT_TRUE(then.ok()) << then.message();
      EXPECT_EQ(pixels, expected);
      return first;
    });
  }
}

TEST(OutOfMemory, SamplersAndSamples) {
  for (const samples::SampleKind kind :
       {samples::SampleKind::kSampler, samples::SampleKind::kStaticSampler}) {
    const Result<std::vector<std::byte>> written = samples::write_sample(kind);
    ASSERT_TRUE(written.ok());
    const tests::AlignedBytes bytes{std::span<const std::byte>(*written)};
    const Result<Package> package = Package::open(bytes.bytes(), "sampler");
    ASSERT_TRUE(package.ok());
    const auto hash_of = [](const SampledAvatar& sampled) {
      const Avatar& avatar = sampled.avatar();
      return hash_weights(avatar.fixed_point, avatar.shape, avatar.static_part);
    };
    const auto made = AvatarSampler::create(package->sampler());
    ASSERT_TRUE(made.ok());
    SampledAvatar person;
    ASSERT_TRUE((*made)->sample({.seed = 7, .steps = 3}, person).ok());
    const auto expected = hash_of(person);
    fail_all("create a sampler", [&](const Window& window) {
      window.begin();
      const auto created = AvatarSampler::create(package->sampler());
      window.end();
      return created.status();
    });
    fail_all("sample", [&](const Window& window) {
      SampledAvatar fresh;
      window.begin();
      const Status status = (*made)->sample({.seed = 7, .steps = 3}, fresh);
      window.end();
      if (status.ok()) {
        EXPECT_EQ(hash_of(fresh), expected);
      }
      EXPECT_TRUE((*made)->sample({.seed = 7, .steps = 3}, fresh).ok());
      EXPECT_EQ(hash_of(fresh), expected);
      return status;
    });
  }
}

// ---- C ------------------------------------------------------------------------------------------

Status status_of(fig_status status) {
  return status == FIG_OK ? Status() : Status(static_cast<StatusCode>(status), fig_last_message());
}

TEST(OutOfMemory, TheInterfaceInC) {
  const SyntheticBody test_body = make_test_body({.uv_size = 32});
  const SyntheticAvatar test_avatar =
      make_test_avatar(test_body, {.held = Held::kFixedPoint, .static_part = true});
  const auto open = [](const tests::AlignedBytes& bytes, fig_package& package) {
    fig_package_options options = fig_default_package_options();
    options.name = "a package whose name is not short", options.copy = 1;
    return fig_package_open(bytes.bytes().data(), bytes.bytes().size(), &options, &package);
  };
  fig_package body{}, avatar{};
  ASSERT_EQ(open(test_body.bytes, body), FIG_OK);
  ASSERT_EQ(open(test_avatar.bytes, avatar), FIG_OK);
  fig_pose pose = fig_default_pose();
  const SyntheticPose posed = make_test_pose(test_body.body(), 1);
  pose.joint_count = static_cast<uint32_t>(posed.rotations.size() / 4);
  pose.rotations = posed.rotations.data();
  fig_camera camera = fig_default_camera();
  fig_orbit orbit = fig_default_orbit();
  orbit.distance_m = 3;
  ASSERT_EQ(fig_make_orbit_camera(&orbit, kWidth, kHeight, &camera), FIG_OK);
  std::vector<uint8_t> pixels(size_t{4} * kWidth * kHeight);
  fig_image image = fig_default_image();
  image.pixels = pixels.data(), image.stride_bytes = size_t{4} * kWidth;
  const auto draw = [&](fig_renderer renderer, fig_avatar drawn) {
    fig_frame_avatar seen = fig_default_frame_avatar();
    seen.avatar = drawn, seen.pose = &pose;
    fig_frame frame = fig_default_frame();
    frame.camera = &camera, frame.avatars = &seen, frame.avatar_count = 1;
    return fig_renderer_render(renderer, &frame, &image);
  };
  fig_renderer renderer{};
  fig_avatar there{};
  ASSERT_EQ(fig_renderer_create(nullptr, &renderer), FIG_OK);
  ASSERT_EQ(fig_renderer_add_avatar(renderer, avatar, 0, body, nullptr, &there), FIG_OK);
  ASSERT_EQ(draw(renderer, there), FIG_OK) << fig_last_message();
  const std::vector<uint8_t> expected = pixels;
  const auto still_works = [&] {
    EXPECT_EQ(draw(renderer, there), FIG_OK) << fig_last_message();
    EXPECT_EQ(pixels, expected);
  };

  fail_all(
      "fig_package_open",
      [&](const Window& window) {
        fig_package package{};
        window.begin();
        const fig_status status = open(test_avatar.bytes, package);
        window.end();
        if (status != FIG_OK) return status_of(status);
        return status_of(fig_package_close(package));
      },
      still_works);
  for (const uint32_t threads : {1u, 2u}) {
    fail_all(
        "fig_renderer_create",
        [&](const Window& window) {
          fig_renderer_options options = fig_default_renderer_options();
          options.threads = threads;
          fig_renderer made{};
          window.begin();
          const fig_status status = fig_renderer_create(&options, &made);
          window.end();
          if (status != FIG_OK) return status_of(status);
          return status_of(fig_renderer_destroy(made));
        },
        still_works);
  }
  fail_all(
      "fig_renderer_add_avatar",
      [&](const Window& window) {
        fig_renderer made{};
        EXPECT_EQ(fig_renderer_create(nullptr, &made), FIG_OK);
        fig_avatar added{};
        window.begin();
        const fig_status first = fig_renderer_add_avatar(made, avatar, 0, body, nullptr, &added);
        const fig_status drawn = first == FIG_OK ? draw(made, added) : first;
        window.end();
        const Status status = status_of(drawn);
        if (first == FIG_OK) {
          EXPECT_EQ(draw(made, added), FIG_OK) << fig_last_message();
        }
        EXPECT_EQ(fig_renderer_destroy(made), FIG_OK);
        return status;
      },
      still_works);
  // What is refused is refused for what is wrong with it.
  fail_all("a handle that is none", [&](const Window& window) {
    window.begin();
    const fig_status status = fig_renderer_render({77}, nullptr, nullptr);
    window.end();
    return status == FIG_INVALID_ARGUMENT ? Status() : status_of(status);
  });
  EXPECT_EQ(fig_renderer_destroy(renderer), FIG_OK);
  EXPECT_EQ(fig_package_close(avatar), FIG_OK);
  EXPECT_EQ(fig_package_close(body), FIG_OK);
}

TEST(OutOfMemory, SamplersInC) {
  const Result<std::vector<std::byte>> written =
      samples::write_sample(samples::SampleKind::kSampler);
  ASSERT_TRUE(written.ok());
  const tests::AlignedBytes bytes{std::span<const std::byte>(*written)};
  fig_package package{};
  ASSERT_EQ(fig_package_open(bytes.bytes().data(), bytes.bytes().size(), nullptr, &package),
            FIG_OK);
  fail_all("fig_sampler_sample", [&](const Window& window) {
    fig_sampler sampler{};
    window.begin();
    const fig_status created = fig_sampler_create(package, nullptr, &sampler);
    fig_sample_options options = fig_default_sample_options();
    options.steps = 2;
    fig_sampled sampled{};
    const fig_status made =
        created == FIG_OK ? fig_sampler_sample(sampler, &options, &sampled) : created;
    window.end();
    const Status status = status_of(made);
    if (made == FIG_OK) {
      EXPECT_EQ(fig_sampled_destroy(sampled), FIG_OK);
    }
    if (created == FIG_OK) {
      EXPECT_EQ(fig_sampler_destroy(sampler), FIG_OK);
    }
    return status;
  });
  EXPECT_EQ(fig_package_close(package), FIG_OK);
}

}  // namespace
}  // namespace figurine::out_of_memory_test
