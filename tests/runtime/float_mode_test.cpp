// Floats in a frame: all threads flush denormals, whatever mode the caller is in; he gets his own
// back, on errors too; and a scene of denormals has the pixels of one of zeros, on any number of
// threads and with every instruction set.
#include "runtime/src/base/float_mode.h"

#include <fenv.h>
#include <gtest/gtest.h>
#include <pthreadpool.h>
#include <sched.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "runtime/sample/random_sampler.h"
#include "runtime/splat_scene.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/test_packages.h"

namespace figurine::float_mode_test {
namespace {

constexpr float kSmallestNormal = std::numeric_limits<float>::min();
constexpr float kDenormal = 1e-40f;

// What this thread does with denormals, by arithmetic that the compiler cannot do.
bool flushes_results() {
  volatile float small = kSmallestNormal;
  return small * 0.5f == 0;
}
bool flushes_inputs() {
  volatile float denormal = kDenormal;
  return denormal * 1e10f == 0;
}
bool flushes() {
  EXPECT_EQ(flushes_results(), flushes_inputs());
  return flushes_results();
}
bool rounds_up() {
  volatile float one = 1, tiny = 1e-10f;
  return one + tiny > 1;
}

// Whether this build's floats have a mode at all (runtime/src/base/float_mode.h).
#if defined(__x86_64__) || defined(__aarch64__)
constexpr bool kHasModes = true;
#else
constexpr bool kHasModes = false;
#endif

class FloatModes : public testing::Test {
 protected:
  void SetUp() override {
    if (!kHasModes) GTEST_SKIP() << "no float modes on this architecture";
    FloatMode::exact().set();
  }
  void TearDown() override {
    ::fedisableexcept(FE_ALL_EXCEPT);
    FloatMode::exact().set();
  }
};

// Callers that a library meets: with IEEE 754's default, with denormals off, with another rounding.
struct Caller {
  const char* name;
  std::function<void()> prepare;
};
const Caller kCallers[] = {{"the default", [] { FloatMode::exact().set(); }},
                           {"denormals off", [] { FloatMode::frame().set(); }},
                           {"rounding up", [] {
                              FloatMode::exact().set();
                              ::fesetround(FE_UPWARD);
                            }}};

TEST_F(FloatModes, AScopeFlushesAndGivesBack) {
  EXPECT_FALSE(flushes());
  ::fesetround(FE_UPWARD);
  {
    const FloatModeScope frame(FloatMode::frame());
    EXPECT_TRUE(flushes());
    EXPECT_FALSE(rounds_up());
    {
      const FloatModeScope exact(FloatMode::exact());
      EXPECT_FALSE(flushes());
    }
    EXPECT_TRUE(flushes());
  }
  EXPECT_FALSE(flushes());
  EXPECT_TRUE(rounds_up());
}

// A task that all threads are in at once says how each of them computes.
uint32_t flushing_threads(ThreadPool& pool) {
  std::atomic<uint32_t> arrived{0}, flushing{0};
  pool.for_each(pool.threads(), [&](size_t) {
    ++arrived;
    while (arrived.load() < pool.threads()) ::sched_yield();
    flushing += flushes() ? 1 : 0;
  });
  return flushing;
}

TEST_F(FloatModes, WorkersTakeTheirCallersMode) {
  Result<ThreadPool> pool = ThreadPool::create(3);
  ASSERT_TRUE(pool.ok() && pool->threads() == 3);
  for (int turn = 0; turn < 3; ++turn) {
    EXPECT_EQ(flushing_threads(*pool), 0u);
    const FloatModeScope frame(FloatMode::frame());
    EXPECT_EQ(flushing_threads(*pool), 3u);
  }
}

struct Meeting {
  uint32_t threads;
  std::atomic<uint32_t> arrived{0}, flushing{0};
};
uint32_t flushing_network_threads(pthreadpool* pool, uint32_t flags) {
  Meeting meeting{.threads = static_cast<uint32_t>(pthreadpool_get_threads_count(pool))};
  pthreadpool_parallelize_1d(
      pool,
      [](void* context, size_t) {
        Meeting& met = *static_cast<Meeting*>(context);
        ++met.arrived;
        while (met.arrived.load() < met.threads) ::sched_yield();
        met.flushing += flushes() ? 1 : 0;
      },
      &meeting, meeting.threads, flags);
  return meeting.flushing;
}

TEST_F(FloatModes, XnnpacksThreadsDoTheSame) {
  pthreadpool* const pool = pthreadpool_create(3);
  ASSERT_EQ(pthreadpool_get_threads_count(pool), 3u);
  for (int turn = 0; turn < 3; ++turn) {
    EXPECT_EQ(flushing_network_threads(pool, 0), 0u);
    EXPECT_EQ(flushing_network_threads(pool, PTHREADPOOL_FLAG_DISABLE_DENORMALS), 3u);
    EXPECT_FALSE(flushes()) << "the caller keeps its own";
    const FloatModeScope frame(FloatMode::frame());
    EXPECT_EQ(flushing_network_threads(pool, 0), 3u);
  }
  pthreadpool_destroy(pool);
}

// A renderer's clock is called inside a frame, by all of its threads.
struct Observed {
  std::atomic<int> exact{0}, flushing{0};
  static uint64_t now(void* user) {
    Observed& self = *static_cast<Observed*>(user);
    ++(flushes() ? self.flushing : self.exact);
    return 0;
  }
};

TEST_F(FloatModes, CallersGetTheirOwnBackWhateverHappens) {
  const tests::SyntheticBody body = tests::make_test_body({.uv_size = 16}),
                             other_body = tests::make_test_body({.uv_size = 32});
  const tests::SyntheticAvatar avatar = tests::make_test_avatar(body, {});
  const tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
  const Camera camera = tests::make_test_camera(64, 64);
  for (const Caller& caller : kCallers) {
    Observed observed;
    Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 2,
                                                                   .allow_oversubscription = true,
                                                                   .now_ns = Observed::now,
                                                                   .now_user = &observed});
    ASSERT_TRUE(renderer.ok());
    caller.prepare();
    const FloatMode before = FloatMode::of_this_thread();
    const auto expect_same = [&](const char* after) {
      EXPECT_TRUE(FloatMode::of_this_thread() == before) << caller.name << ", after " << after;
    };
    const Result<AvatarId> id = (*renderer)->add_avatar(*avatar.package, *body.package);
    expect_same("adding");
    ASSERT_TRUE(id.ok());
    EXPECT_FALSE((*renderer)->add_avatar(*avatar.package, *other_body.package).ok());
    expect_same("adding on the wrong body");
    EXPECT_TRUE((*renderer)->pose_avatar(*id, pose.view()).ok());
    expect_same("posing");
    EXPECT_FALSE((*renderer)->pose_avatar(AvatarId(77), pose.view()).ok());
    expect_same("posing nobody");
    const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
    Frame frame{.camera = camera, .avatars = seen};
    std::vector<uint8_t> rgba(64 * 64 * 4);
    const ImageTarget target{.pixels = rgba.data(), .stride_bytes = 256};
    EXPECT_TRUE((*renderer)->render(frame, target).ok());
    expect_same("a frame");
    EXPECT_GT(observed.flushing.load(), 0);
    EXPECT_EQ(observed.exact.load(), 0) << caller.name;
    frame.camera.fx_px = NAN;
    EXPECT_FALSE((*renderer)->render(frame, target).ok());
    expect_same("a refused frame");
  }
}

// Positions, factors, opacities and colours, some of them below the smallest normal; `zero`: the
// same with zeros in their place.
tests::Scene make_denormal_scene(bool zero) {
  tests::Scene scene = tests::make_random_scene(1500, 1, 11);
  tests::Random random(12);
  for (std::vector<float>* values : {&scene.position, &scene.factor, &scene.opacity, &scene.sh}) {
    for (float& value : *values) {
      if (random.uniform(0, 1) > 0.25f) continue;
      const float size = random.uniform(1e-4f, 10), tiny = zero ? 0.0f : kDenormal * size;
      const bool negative = values != &scene.opacity && random.uniform(0, 1) < 0.5f;
      value = negative ? -tiny : tiny;
    }
  }
  return scene;
}

TEST_F(FloatModes, ASceneOfDenormalsIsOneOfZerosOnAllThreadsAndInstructionSets) {
  const tests::Scene denormal = make_denormal_scene(false), zero = make_denormal_scene(true);
  const Camera camera = tests::front_camera(96, 80, 80);
  std::optional<std::vector<float>> first;
  for (const tests::Scene* scene : {&denormal, &zero}) {
    const GaussianView view = scene->view();
    for (const Isa isa : supported_isas()) {
      for (const uint32_t threads : {1u, 2u}) {
        for (const Caller& caller : kCallers) {
          caller.prepare();
          Result<std::unique_ptr<Renderer>> renderer =
              Renderer::create({.threads = threads, .allow_oversubscription = true, .isa = isa});
          ASSERT_TRUE(renderer.ok());
          for (const bool fast : {false, true}) {
            // The fast tier has other last bits; it must cope, no more.
            const tests::FloatImage image = tests::render(
                **renderer,
                {.camera = camera, .gaussians = {&view, 1}, .approximation = {.fast_blend = fast}});
            if (!first) first = image.rgba;
            EXPECT_TRUE(fast || image.rgba == *first)
                << to_string(isa) << ", " << threads << " threads, " << caller.name
                << (scene == &zero ? ", zeros" : ", denormals");
          }
          EXPECT_GT((*renderer)->statistics().visible, 100u);
        }
      }
    }
  }
}

// An avatar whose pose is a denormal away from rest, before callers of all kinds.
TEST_F(FloatModes, AnAvatarHasTheSameBitsWhateverItsCallersMode) {
  const tests::SyntheticBody body = tests::make_test_body({.uv_size = 16});
  for (const tests::Held held : {tests::Held::kFixedPoint, tests::Held::kFloat32}) {
    const tests::SyntheticAvatar avatar = tests::make_test_avatar(body, {.held = held});
    tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
    for (size_t i = 0; i < pose.rotations.size(); i += 4) {
      pose.rotations[i + 1] = kDenormal;
      pose.rotations[i + 3] = -kDenormal;
    }
    const Camera camera = tests::make_test_camera(64, 64);
    std::optional<std::vector<float>> first;
    for (const uint32_t threads : {1u, 2u}) {
      for (const Caller& caller : kCallers) {
        caller.prepare();
        const std::unique_ptr<Renderer> renderer = tests::make_renderer(threads);
        const Result<AvatarId> id = renderer->add_avatar(*avatar.package, *body.package);
        ASSERT_TRUE(id.ok());
        const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
        const tests::FloatImage image =
            tests::render(*renderer, {.camera = camera, .avatars = seen});
        if (!first) first = image.rgba;
        EXPECT_TRUE(image.rgba == *first) << threads << " threads, " << caller.name;
      }
    }
  }
}

// Programs may have asked for signals where arithmetic has no result.
TEST_F(FloatModes, CallersTrapsDoNotReachAFrame) {
  if (::feenableexcept(FE_INVALID | FE_UNDERFLOW) == -1 ||
      ::fegetexcept() != (FE_INVALID | FE_UNDERFLOW))
    GTEST_SKIP() << "no traps on this CPU";
  tests::Scene scene = tests::make_random_scene(200, 0, 3);
  for (size_t i = 0; i < scene.opacity.size(); i += 3) scene.factor[9 * i] = INFINITY;
  const tests::FloatImage image = tests::render(scene, tests::front_camera(32, 32, 30), {}, 2);
  EXPECT_EQ(::fegetexcept(), FE_INVALID | FE_UNDERFLOW);
  ::fedisableexcept(FE_ALL_EXCEPT);
  EXPECT_TRUE(image.rgba == tests::render(scene, tests::front_camera(32, 32, 30)).rgba);
}

// Watches the mode from inside.
struct FlushTrace final : AvatarSampler::Trace {
  int exact = 0, flushing = 0;
  Status after_step(uint32_t, double, const SampledAvatar&) override {
    ++(flushes() ? flushing : exact);
    return {};
  }
};

TEST_F(FloatModes, SamplingKeepsDenormalsAndHasTheSameBitsForAllCallers) {
  const tests::RandomSampler random;
  std::optional<std::array<uint64_t, 2>> first;
  for (const Caller& caller : kCallers) {
    caller.prepare();
    const FloatMode before = FloatMode::of_this_thread();
    const auto sampler = AvatarSampler::create(random.view);
    ASSERT_TRUE(sampler.ok());
    SampledAvatar person;
    FlushTrace trace;
    ASSERT_TRUE((*sampler)->sample({.seed = 5, .steps = 4}, person, &trace).ok());
    EXPECT_TRUE(FloatMode::of_this_thread() == before) << caller.name;
    EXPECT_EQ(trace.flushing, 0) << caller.name;
    EXPECT_EQ(trace.exact, 4);
    const auto hash = hash_weights(person.avatar().fixed_point, person.avatar().shape);
    if (!first) first = hash;
    EXPECT_EQ(hash, *first) << caller.name;
    EXPECT_FALSE((*sampler)->sample({.mix = 2}, person).ok());
    EXPECT_TRUE(FloatMode::of_this_thread() == before) << caller.name;
  }
}

}  // namespace
}  // namespace figurine::float_mode_test
