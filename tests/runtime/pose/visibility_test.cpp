// Which texels may be seen: never too few, by projecting the worst that their bounds allow; and not
// all of them, where a camera plainly looks elsewhere.
#include "runtime/src/pose/visibility.h"

#include <gtest/gtest.h>

#include <cmath>

#include "figurine/gaussian.h"
#include "runtime/src/splat/view.h"
#include "runtime/test_packages.h"

namespace figurine::visibility_test {
namespace {

constexpr HeadDecoding kBounded{.max_log_scale = 1, .max_offset = 1};

kernels::View view_of(const Camera& camera) { return make_view(camera, kAlphaCut); }

Camera camera_at(float z, uint32_t size = 64) {
  Camera camera{.width_px = size,
                .height_px = size,
                .fx_px = 80,
                .fy_px = 80,
                .cx_px = 0.5f * static_cast<float>(size),
                .cy_px = 0.5f * static_cast<float>(size)};
  camera.view_from_world[11] = z;
  return camera;
}

// All lanes at one place, moved by the identity.
struct Place {
  kernels::CanonicalBlock texels{};
  kernels::TransformBlock transforms{};
  Place(float x, float y, float z) {
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      texels.position_m[0][lane] = x, texels.position_m[1][lane] = y;
      texels.position_m[2][lane] = z;
      texels.extent_m[lane] = 0.005f;
      for (int k = 0; k < 9; k += 4) transforms.linear[k][lane] = 1;
    }
  }
};

bool seen(const Place& place, const Camera& camera, const HeadDecoding& decoding = kBounded) {
  return may_be_seen(place.texels, place.transforms, bounds_of(decoding), view_of(camera));
}

TEST(Visibility, BoundsAreThoseOfTheDecoding) {
  const GaussianBounds bounds =
      bounds_of({.offset_scale_m = 0.05f, .max_log_scale = 2, .max_offset = 3});
  EXPECT_FLOAT_EQ(bounds.offset_m, 0.05f * 3 * std::sqrt(3.0f));
  EXPECT_NEAR(bounds.extents, std::exp(2.0), 1e-5);
  EXPECT_TRUE(std::isinf(bounds_of({}).offset_m)) << "a decoding without a bound has none";
}

TEST(Visibility, WhatIsPlainlyElsewhereIsLeftOut) {
  const Camera camera = camera_at(3);
  EXPECT_TRUE(seen({0, 0, 0}, camera));
  EXPECT_FALSE(seen({5, 0, 0}, camera));
  EXPECT_FALSE(seen({0, -5, 0}, camera));
  EXPECT_FALSE(seen({0, 0, -4}, camera)) << "behind";
  EXPECT_TRUE(seen({0, 0, -2.8f}, camera)) << "at the near plane nothing is known";
}

TEST(Visibility, WithoutABoundEverythingMayBeSeen) {
  EXPECT_TRUE(seen({5, 0, 0}, camera_at(3), {}));
}

TEST(Visibility, WhatIsNotFiniteMayBeSeen) {
  Place place(5, 0, 0);
  place.transforms.linear[0][7] = NAN;
  EXPECT_TRUE(seen(place, camera_at(3)));
}

// The strictest test there is: texels, cameras and the Gaussians that the decoding may make of
// them, all random, offsets mostly at their bounds. Whatever projection sees must not have been
// left out.
TEST(Visibility, NothingThatProjectionSeesIsLeftOut) {
  tests::Random random(3);
  uint32_t left_out = 0, projected_seen = 0;
  for (int round = 0; round < 20000; ++round) {
    Place place(random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-4, 3));
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      for (auto& plane : place.transforms.linear) plane[lane] += random.uniform(-0.5f, 0.5f);
      for (auto& plane : place.texels.position_m) plane[lane] += random.uniform(-0.02f, 0.02f);
    }
    const Camera camera = camera_at(random.uniform(0.5f, 5), 16 + round % 100);
    const kernels::View view = view_of(camera);
    kernels::ExtentBlock smallest{};
    float largest_m = 0;
    if (round % 2 == 1) {  // up to twenty times what a texel's own Gaussian is
      for (float& s : smallest.smallest_m) {
        s = random.uniform(0, 0.1f);
        largest_m = std::max(largest_m, s);
      }
    }
    const bool may =
        may_be_seen(place.texels, place.transforms, bounds_of(kBounded, largest_m), view);
    left_out += may ? 0 : 1;
    kernels::GaussianBlock block;
    float heads[kernels::kLanes][14];
    kernels::DecodeSkinJob job{.head = {},
                               .taps = nullptr,
                               .static_part = nullptr,
                               .smallest = round % 2 == 1 ? &smallest : nullptr,
                               .texels = &place.texels,
                               .transforms = &place.transforms,
                               .offset_scale_m = kBounded.offset_scale_m,
                               .max_offset = kBounded.max_offset,
                               .max_log_scale = kBounded.max_log_scale,
                               .opacity_bias = 20,
                               .sh_values = 3,
                               .gaussians = &block};
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      for (float& value : heads[lane]) value = random.uniform(-2, 2);
      job.head[0][lane] = heads[lane];
    }
    const KernelTable& kernels = best_kernels();
    kernels.decode_skin(job);
    kernels::Splat splats[kernels::kLanes];
    float depth_m[kernels::kLanes];
    const kernels::ProjectedLanes lanes = kernels.project_block(
        {.view = &view,
         .gaussians = &block,
         .count = kernels::kLanes,
         .sh_degree = 0,
         .leave_out = kernels::kLeaveOutTransparent | kernels::kLeaveOutOutside,
         .antialiased = 0,
         .splats = splats,
         .depth_m = depth_m});
    projected_seen += lanes.visible != 0 ? 1 : 0;
    ASSERT_TRUE(may || lanes.visible == 0) << "round " << round;
  }
  EXPECT_GT(left_out, 3000u) << "a test of bounds that leave out nothing is none";
  EXPECT_GT(projected_seen, 2000u);
}

}  // namespace
}  // namespace figurine::visibility_test
