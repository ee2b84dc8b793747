// Random and extreme inputs of every kernel, for comparing two kernels of one operation to the bit.
//
// compare(a, b) runs both on the same inputs into outputs that hold different garbage before, so
// that a value which a kernel forgets to write, or reads before, is a difference.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "runtime/src/kernels/kernel.h"
#include "runtime/test_packages.h"

namespace figurine::kernels::tests {

using figurine::tests::Random;

inline uint32_t below(Random& random, uint32_t limit) {
  return static_cast<uint32_t>(random.uniform(0, 1) * static_cast<float>(limit)) % limit;
}

// Now and then something that only hostile data holds.
inline float strange(Random& random, float usual) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kStrange[] = {0.0f,
                                -0.0f,
                                1e-38f,
                                -1e-38f,
                                3e38f,
                                -3e38f,
                                kInf,
                                -kInf,
                                1e-30f,
                                1e18f,
                                std::numeric_limits<float>::quiet_NaN()};
  return random.uniform(0, 1) < 0.02f ? kStrange[below(random, 11)] : usual;
}

template <size_t N, size_t M>
void fill(float (&planes)[N][M], Random& random, float low, float high, bool hostile = false) {
  for (auto& plane : planes) {
    for (float& value : plane) {
      value = random.uniform(low, high);
      if (hostile) value = strange(random, value);
    }
  }
}

// Equal bits, but that any NaN equals any other.
inline void expect_same_bits(const float* a, const float* b, size_t count, const char* what) {
  for (size_t i = 0; i < count; ++i) {
    if (a[i] != a[i] && b[i] != b[i]) continue;
    ASSERT_EQ(std::memcmp(&a[i], &b[i], sizeof(float)), 0)
        << what << "[" << i << "]: " << a[i] << " and " << b[i];
  }
}

inline TexelBlock make_texels(Random& random, uint32_t joints) {
  TexelBlock block{};
  fill(block.mean_position_m, random, -1, 1);
  fill(block.mean_normal, random, -1, 1);
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    const uint32_t used = 1 + below(random, kInfluences);
    for (uint32_t k = 0; k < used; ++k) {
      block.joint[k][lane] = static_cast<uint8_t>(below(random, joints));
      block.weight[k][lane] = 1.0f / static_cast<float>(used);
    }
  }
  return block;
}

inline TransformBlock make_transforms(Random& random, bool hostile = false) {
  TransformBlock block{};
  fill(block.linear, random, -1, 1, hostile);
  fill(block.mean_translation_m, random, -2, 2, hostile);
  fill(block.own_translation_m, random, -2, 2, hostile);
  return block;
}

inline GaussianBlock make_gaussians(Random& random, bool hostile) {
  GaussianBlock block{};
  fill(block.position_m, random, -2, 2, hostile);
  fill(block.factor, random, -0.05f, 0.05f, hostile);
  for (float& opacity : block.opacity) opacity = random.uniform(-0.02f, 1);
  for (auto& plane : block.sh) {
    for (float& value : plane) value = random.normal();
  }
  if (hostile) {
    for (float& opacity : block.opacity) opacity = strange(random, opacity);
    fill(block.sh, random, -1, 1, true);
  }
  return block;
}

inline View make_view(Random& random) {
  View view{.view_from_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 3},
            .camera_centre_m = {0, 0, -3},
            .fx_px = random.uniform(20, 400),
            .fy_px = random.uniform(20, 400),
            .cx_px = 70,
            .cy_px = 40,
            .near_m = random.uniform(0.05f, 2),
            .tan_x_min = -1.5f,
            .tan_x_max = 1.25f,
            .tan_y_min = -1,
            .tan_y_max = 1.5f,
            .width_px = 1 + below(random, 300),
            .height_px = 1 + below(random, 200),
            .alpha_cut = 1.0f / 255};
  return view;
}

// As projection bounds it: no pixel beyond `reach` and `half_height` gets to an alpha of 1/255. The
// ellipse is widest where x = slope dy + sqrt(reach - v^2) / scale_u is; projection's slack lies
// upon that, which puts a needle's widest point outside of it.
inline void set_opacity(float opacity, Splat& splat) {
  splat.opacity = opacity;
  splat.reach = std::max(0.0f, std::log2(opacity * 255)) + 1e-3f;
  splat.half_height = std::sqrt(splat.reach) / splat.scale_v * 1.0001f + 1e-3f;
  const float skew = splat.slope * splat.scale_u / splat.scale_v;
  splat.widest_dy_px =
      1.0001f * std::sqrt(splat.reach) * skew / std::sqrt(1 + skew * skew) / splat.scale_v;
}

// Every ninth is a needle that lies nearly along a row.
inline Splat make_splat(Random& random) {
  const bool needle = below(random, 9) == 0;
  const float scale_u = random.uniform(0.02f, 1.2f),
              scale_v = random.uniform(needle ? 0.8f : 0.02f, 1.2f);
  Splat splat{.mean_x = random.uniform(-20, 90),
              .mean_y = random.uniform(-20, 90),
              .slope = needle
                           ? std::exp(random.uniform(0, 8)) * (below(random, 2) == 0 ? 1.0f : -1.0f)
                           : random.uniform(-2, 2),
              .scale_u = scale_u,
              .scale_v = scale_v,
              .inverse_scale_u = 1 / scale_u,
              .reach = 0,
              .half_height = 0,
              .opacity = 0,
              .red = random.uniform(0, 2),
              .green = random.uniform(0, 2),
              .blue = random.uniform(0, 2),
              .widest_dy_px = 0,
              .tile_x_begin = 0,
              .tile_y_begin = 0,
              .tile_x_last = 2,
              .tile_y_last = 2};
  set_opacity(random.uniform(0.005f, 1.2f), splat);
  if (needle)  // with its end, where bounds cancel, in reach of the tiles
    splat.mean_x = random.uniform(-5, 75) - splat.slope * splat.widest_dy_px;
  return splat;
}

inline void compare(BlendTransforms* a, BlendTransforms* b) {
  Random random(1);
  constexpr uint32_t kJoints = 9;
  for (int round = 0; round < 200; ++round) {
    const TexelBlock texels = make_texels(random, kJoints);
    std::vector<float> mean(12 * kJoints), own;
    for (float& value : mean) value = strange(random, random.uniform(-2, 2));
    own = mean;
    for (size_t i = 3; i < own.size(); i += 4) own[i] = random.uniform(-2, 2);
    TransformBlock of_a, of_b;
    std::memset(static_cast<void*>(&of_a), 0x55, sizeof(of_a));
    std::memset(static_cast<void*>(&of_b), 0xaa, sizeof(of_b));
    a({&texels, mean.data(), own.data(), &of_a});
    b({&texels, mean.data(), own.data(), &of_b});
    expect_same_bits(&of_a.linear[0][0], &of_b.linear[0][0], sizeof(of_a) / sizeof(float),
                     "transforms");
  }
}

inline void compare(PoseMaps* a, PoseMaps* b) {
  Random random(2);
  for (int round = 0; round < 200; ++round) {
    const TexelBlock texels = make_texels(random, 4);
    const TransformBlock transforms = make_transforms(random, round % 2 == 1);
    PoseMapsJob job{.texels = &texels,
                    .transforms = &transforms,
                    .root_m = {0.1f, -0.2f, 0.3f},
                    .mean = {0.1f, 0.2f, 0.3f, 0, 0.1f, 0},
                    .scale = {2, 3, 4, 1, 0.5f, 2},
                    .maps = nullptr};
    float of_a[kMapPlanes][kLanes], of_b[kMapPlanes][kLanes];
    std::memset(of_a, 0x55, sizeof(of_a));
    std::memset(of_b, 0xaa, sizeof(of_b));
    job.maps = of_a;
    a(job);
    job.maps = of_b;
    b(job);
    expect_same_bits(&of_a[0][0], &of_b[0][0], kMapPlanes * kLanes, "maps");
  }
}

// Weights that add up to 1, or some that do not.
inline TapBlock make_taps(Random& random, bool hostile) {
  TapBlock taps{};
  fill(taps.weight, random, 0, 0.5f, hostile);
  return taps;
}

inline StaticBlock make_static(Random& random, bool hostile) {
  StaticBlock block{};
  fill(block.sum, random, -2, 2, hostile);
  fill(block.gain, random, 0.1f, 3, hostile);
  return block;
}

// Every third lane has none.
inline ExtentBlock make_extents(Random& random) {
  ExtentBlock block{};
  for (uint32_t lane = 0; lane < kLanes; ++lane)
    block.smallest_m[lane] = lane % 3 == 0 ? 0 : random.uniform(1e-9f, 0.02f);
  return block;
}

// With and without taps, static part and smallest extents, of every SH degree, every other round
// hostile.
inline void compare(DecodeSkin* a, DecodeSkin* b) {
  Random random(3);
  for (int round = 0; round < 640; ++round) {
    const bool hostile = round % 2 == 1;
    const uint32_t degree = static_cast<uint32_t>(round / 2) % 4,
                   sh_values = 3 * (degree + 1) * (degree + 1), values = kShapeValues + sh_values;
    const TransformBlock transforms = make_transforms(random, hostile);
    const TapBlock taps = make_taps(random, hostile);
    const StaticBlock static_part = make_static(random, hostile);
    const ExtentBlock smallest = make_extents(random);
    CanonicalBlock texels;
    fill(texels.position_m, random, -1, 1);
    for (float& extent : texels.extent_m) extent = random.uniform(0.001f, 0.01f);
    std::vector<float> heads(kTaps * kLanes * values);
    for (float& value : heads) {
      value = random.normal() * 3;
      if (hostile) value = strange(random, value);
    }
    GaussianBlock of_a, of_b;
    std::memset(static_cast<void*>(&of_a), 0x55, sizeof(of_a));
    std::memset(static_cast<void*>(&of_b), 0xaa, sizeof(of_b));
    DecodeSkinJob job{.head = {},
                      .taps = round / 8 % 2 == 0 ? nullptr : &taps,
                      .static_part = round / 16 % 2 == 0 ? nullptr : &static_part,
                      .smallest = round / 32 % 2 == 0 ? nullptr : &smallest,
                      .texels = &texels,
                      .transforms = &transforms,
                      .offset_scale_m = 0.05f,
                      .max_offset = round % 3 == 0 ? 1.5f : std::numeric_limits<float>::infinity(),
                      .max_log_scale = 4,
                      .opacity_bias = 2,
                      .sh_values = sh_values,
                      .gaussians = &of_a};
    for (uint32_t k = 0; k < (job.taps == nullptr ? 1 : kTaps); ++k) {
      for (uint32_t lane = 0; lane < kLanes; ++lane)
        job.head[k][lane] = &heads[below(random, kTaps * kLanes) * values];
    }
    a(job);
    job.gaussians = &of_b;
    b(job);
    expect_same_bits(&of_a.position_m[0][0], &of_b.position_m[0][0],
                     (3 + 9 + 1 + sh_values) * kLanes, "Gaussians");
  }
}

inline void compare(ProjectBlock* a, ProjectBlock* b) {
  constexpr size_t kSplatBytes = offsetof(Splat, tile_y_last) + sizeof(uint16_t);  // no padding
  Random random(4);
  uint32_t seen = 0, unseen = 0;
  for (uint32_t round = 0; round < 2000; ++round) {
    const GaussianBlock gaussians = make_gaussians(random, round % 2 == 1);
    const View view = make_view(random);
    const uint32_t count = 1 + below(random, kLanes);
    Splat of_a[kLanes], of_b[kLanes];
    float depth_a[kLanes], depth_b[kLanes];
    ProjectJob job{.view = &view,
                   .gaussians = &gaussians,
                   .count = count,
                   .sh_degree = round % 4,
                   .leave_out = round / 4 % 4,
                   .antialiased = round / 16 % 2,
                   .splats = of_a,
                   .depth_m = depth_a};
    const ProjectedLanes lanes_a = a(job);
    job.splats = of_b;
    job.depth_m = depth_b;
    const ProjectedLanes lanes_b = b(job);
    ASSERT_EQ(lanes_a.visible, lanes_b.visible);
    ASSERT_EQ(lanes_a.transparent, lanes_b.transparent);
    ASSERT_EQ(lanes_a.outside, lanes_b.outside);
    for (uint32_t lane = 0; lane < count; ++lane) {
      if ((lanes_a.visible >> lane & 1) == 0) {
        ++unseen;
        continue;
      }
      ++seen;
      ASSERT_EQ(std::memcmp(&of_a[lane], &of_b[lane], kSplatBytes), 0) << "lane " << lane;
      ASSERT_EQ(depth_a[lane], depth_b[lane]);
    }
  }
  EXPECT_GT(seen, 2000u);
  EXPECT_GT(unseen, 2000u);
}

// A tile of random splats, now and then with one of an opacity that no picture has. The order
// takes some several times.
struct RandomTile {
  std::vector<Splat> splats;
  std::vector<uint32_t> order;
  BlendTileJob job{};

  RandomTile(Random& random, uint32_t round) : splats(1 + below(random, 150)) {
    for (Splat& splat : splats) splat = make_splat(random);
    if (round % 5 == 4) set_opacity(1e30f, splats[0]);
    order.resize(splats.size());
    for (uint32_t& index : order) index = below(random, static_cast<uint32_t>(splats.size()));
    job = {.splats = splats.data(),
           .order = order.data(),
           .count = static_cast<uint32_t>(order.size()),
           .x = 32 * static_cast<int32_t>(below(random, 3)),
           .y = 32 * static_cast<int32_t>(below(random, 3)),
           .width = 1 + static_cast<int32_t>(below(random, 32)),
           .height = 1 + static_cast<int32_t>(below(random, 32)),
           .alpha_cut = round % 2 == 0 ? 1.0f / 255 : 0.1f,
           .leave_out_stopped = round % 3 == 0 ? 0u : 1u,
           .pixels = nullptr};
  }
};

inline void compare(BlendTile* a, BlendTile* b) {
  Random random(5);
  uint64_t contributions = 0;
  const auto of_a = std::make_unique<TilePixels>(), of_b = std::make_unique<TilePixels>();
  for (uint32_t round = 0; round < 200; ++round) {
    RandomTile tile(random, round);
    BlendTileJob& job = tile.job;
    std::memset(static_cast<void*>(of_a.get()), 0x55, sizeof(TilePixels));
    std::memset(static_cast<void*>(of_b.get()), 0xaa, sizeof(TilePixels));
    job.pixels = of_a.get();
    const BlendedTile result_a = a(job);
    job.pixels = of_b.get();
    const BlendedTile result_b = b(job);
    ASSERT_EQ(result_a.contributions, result_b.contributions);
    ASSERT_EQ(result_a.splats, result_b.splats);
    // Pixels outside the image may hold anything that a whole block computes; those inside may not.
    for (int32_t y = 0; y < job.height; ++y) {
      for (const auto plane :
           {&TilePixels::red, &TilePixels::green, &TilePixels::blue, &TilePixels::transmittance}) {
        expect_same_bits((*of_a).*plane + y * kTileSize, (*of_b).*plane + y * kTileSize,
                         static_cast<size_t>(job.width), "pixels");
      }
    }
    contributions += result_a.contributions;
  }
  EXPECT_GT(contributions, 30000u);
}

// Near, not equal: a pixel may stop at 1/255 of its light, and then has the contribution that took
// it there, for which up to 1/100 was left; what lies at the cut may be on either side of it.
// Colours here reach 2.
inline void compare(BlendTileFast* a, BlendTileFast* b) {
  Random random(5);
  double squares = 0, values = 0;
  const auto of_a = std::make_unique<TilePixels>(), of_b = std::make_unique<TilePixels>();
  for (uint32_t round = 0; round < 200; ++round) {
    RandomTile tile(random, round);
    BlendTileJob& job = tile.job;
    job.pixels = of_a.get();
    const BlendedTile result_a = a(job, {});
    job.pixels = of_b.get();
    b(job, {});
    ASSERT_LE(result_a.splats, job.count);
    const float largest = 2 * (0.01f + 1.0f / 255 + 1e-3f) + 2 * job.alpha_cut;
    for (int32_t i = 0; i < kTileSize * job.height; ++i) {
      if (i % kTileSize >= job.width) continue;
      for (const auto plane : {&TilePixels::red, &TilePixels::green, &TilePixels::blue}) {
        const float difference = ((*of_a).*plane)[i] - ((*of_b).*plane)[i];
        ASSERT_LE(std::abs(difference), largest) << "round " << round << ", pixel " << i;
        squares += double(difference) * double(difference), values += 1;
      }
      ASSERT_NEAR(std::abs(of_a->transmittance[i]), std::abs(of_b->transmittance[i]), largest);
    }
  }
  std::printf("fast blend: %.1f dB\n", -10 * std::log10(squares / values + 1e-30));
  EXPECT_LE(squares, values * 1e-5);
}

inline void compare(ResolveRows* a, ResolveRows* b) {
  Random random(6);
  const auto pixels = std::make_unique<TilePixels>();
  constexpr float kBackground[3] = {0.25f, 1.5f, -0.5f};
  for (uint32_t round = 0; round < 100; ++round) {
    for (int32_t i = 0; i < kTilePixels; ++i) {
      pixels->red[i] = strange(random, random.uniform(-0.2f, 1.3f));
      pixels->green[i] = strange(random, random.uniform(-0.2f, 1.3f));
      pixels->blue[i] = strange(random, random.uniform(-0.2f, 1.3f));
      pixels->transmittance[i] = round % 4 == 0 ? 1.0f : random.uniform(-1, 1);
    }
    const bool bytes = round % 2 == 0;
    const size_t pixel_bytes = bytes ? 4 : 16, stride = 33 * 16;
    std::vector<uint8_t> of_a(32 * stride, 0x55), of_b(32 * stride, 0x55);
    ResolveRowsJob job{.pixels = pixels.get(),
                       .first_row = static_cast<int32_t>(below(random, 8)),
                       .rows = 1 + static_cast<int32_t>(below(random, 24)),
                       .width = 1 + static_cast<int32_t>(below(random, 32)),
                       .background = round % 3 == 0 ? nullptr : kBackground,
                       .format = bytes ? kResolveRgba8 : kResolveRgbaF32,
                       .out = of_a.data(),
                       .stride_bytes = stride};
    a(job);
    job.out = of_b.data();
    b(job);
    for (int32_t row = 0; row < 32; ++row) {
      const uint8_t *row_a = &of_a[static_cast<size_t>(row) * stride],
                    *row_b = &of_b[static_cast<size_t>(row) * stride];
      const size_t used = row < job.rows ? static_cast<size_t>(job.width) * pixel_bytes : 0;
      if (bytes) {
        ASSERT_EQ(std::memcmp(row_a, row_b, used), 0) << "row " << row;
      } else if (used != 0) {
        std::vector<float> float_a(used / 4), float_b(used / 4);
        std::memcpy(float_a.data(), row_a, used);
        std::memcpy(float_b.data(), row_b, used);
        expect_same_bits(float_a.data(), float_b.data(), float_a.size(), "row");
      }
      for (size_t i = used; i < stride; ++i) {
        ASSERT_EQ(row_a[i], 0x55) << "written behind the row's end";
        ASSERT_EQ(row_b[i], 0x55) << "written behind the row's end";
      }
    }
  }
}

inline void compare(AddDots* a, AddDots* b) {
  Random random(7);
  for (uint32_t round = 0; round < 200; ++round) {
    const size_t length = kDotMultiple * (1 + below(random, 40)),
                 count = kDotsAtOnce * (1 + below(random, 9));
    alignas(64) static int16_t shared[kDotMultiple * 40], rows[kDotMultiple * 40 * kDotsAtOnce * 9];
    const auto any = [&](int limit) {
      return static_cast<int16_t>(static_cast<int>(below(random, 2 * limit)) - limit);
    };
    // Within what int32 sums hold: 320 products of 2,000 by 3,000.
    for (size_t i = 0; i < length; ++i) shared[i] = any(2000);
    for (size_t i = 0; i < length * count; ++i) rows[i] = any(3000);
    std::vector<int32_t> of_a(count), of_b;
    for (int32_t& sum : of_a) sum = any(10000);
    of_b = of_a;
    std::vector<int64_t> truth(of_a.begin(), of_a.end());
    for (size_t i = 0; i < count; ++i) {
      for (size_t k = 0; k < length; ++k) truth[i] += int64_t{shared[k]} * rows[i * length + k];
    }
    a({shared, rows, length, count, of_a.data()});
    b({shared, rows, length, count, of_b.data()});
    ASSERT_EQ(of_a, of_b);
    for (size_t i = 0; i < count; ++i) ASSERT_EQ(of_a[i], truth[i]);
  }
}

}  // namespace figurine::kernels::tests
