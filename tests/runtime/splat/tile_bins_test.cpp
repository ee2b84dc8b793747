#include "runtime/src/splat/tile_bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "runtime/test_packages.h"

namespace figurine::tile_bins_test {
namespace {

using kernels::Splat;
using Lists = std::map<uint32_t, std::vector<uint32_t>>;  // a tile's splats, front to back

constexpr uint32_t kWidth = 200, kHeight = 130;

// An ellipse of the covariance [[a, b], [b, c]] that alpha leaves at 3 deviations.
Splat ellipse(float x, float y, float a, float b, float c) {
  const float determinant = a * c - b * b, log2e = 1.44269504f, reach = 9 * 0.5f * log2e;
  const float half_width = 3 * std::sqrt(a), half_height = 3 * std::sqrt(c);
  const auto tile = [](float at, uint32_t size) {
    return static_cast<uint16_t>(std::clamp(at, 0.0f, static_cast<float>(size - 1)) / 32);
  };
  const float scale_u = std::sqrt(c / determinant * 0.5f * log2e);
  return {.mean_x = x,
          .mean_y = y,
          .slope = b / c,
          .scale_u = scale_u,
          .scale_v = std::sqrt(0.5f * log2e / c),
          .inverse_scale_u = 1 / scale_u,
          .reach = reach,
          .half_height = half_height,
          .opacity = 1,
          .red = 0,
          .green = 0,
          .blue = 0,
          .widest_dy_px = b / a * half_width,
          .tile_x_begin = tile(x - half_width, kWidth),
          .tile_y_begin = tile(y - half_height, kHeight),
          .tile_x_last = tile(x + half_width, kWidth),
          .tile_y_last = tile(y + half_height, kHeight)};
}

std::vector<Splat> random_splats(uint32_t count, float largest) {
  tests::Random random(count);
  std::vector<Splat> splats;
  for (uint32_t i = 0; i < count; ++i) {
    const float a = random.uniform(1, largest), c = random.uniform(1, largest),
                b = random.uniform(-0.99f, 0.99f) * std::sqrt(a * c);
    splats.push_back(ellipse(random.uniform(0, kWidth), random.uniform(0, kHeight), a, b, c));
  }
  return splats;
}

std::vector<DepthSort::Item> reversed(size_t count) {
  std::vector<DepthSort::Item> sorted;
  for (size_t i = count; i-- > 0;) sorted.push_back({0, static_cast<uint32_t>(i)});
  return sorted;
}

struct Binned {
  Lists lists;
  uint64_t pairs = 0, missed = 0;
  uint32_t bands = 0;
};

Binned bin(const std::vector<Splat>& splats, const std::vector<DepthSort::Item>& sorted, bool exact,
           uint32_t threads, size_t prepared_for) {
  ThreadPool pool = std::move(ThreadPool::create(threads)).value();
  TileBins bins(pool);
  EXPECT_TRUE(bins.prepare(kWidth, kHeight, prepared_for));
  bins.count(splats.data(), sorted.data(), static_cast<uint32_t>(sorted.size()), exact);
  Binned binned{.lists = {}, .pairs = bins.pair_count(), .missed = bins.missed_pairs()};
  for (TileBins::Band band{0, 0}; band.end < bins.tiles(); ++binned.bands) {
    band = bins.fill_band(band.end);
    EXPECT_GT(band.end, band.begin);
    for (uint32_t tile = band.begin; tile < band.end; ++tile) {
      if (bins.count_of(tile) == 0) continue;
      binned.lists[tile] = {bins.order(tile), bins.order(tile) + bins.count_of(tile)};
    }
  }
  return binned;
}

// Every tile of every box, in the order of `sorted`.
Lists boxes(const std::vector<Splat>& splats, const std::vector<DepthSort::Item>& sorted) {
  Lists lists;
  const uint32_t tiles_x = (kWidth + 31) / 32;
  for (const DepthSort::Item& item : sorted) {
    const Splat& splat = splats[item.index];
    for (uint32_t y = splat.tile_y_begin; y <= splat.tile_y_last; ++y) {
      for (uint32_t x = splat.tile_x_begin; x <= splat.tile_x_last; ++x)
        lists[y * tiles_x + x].push_back(item.index);
    }
  }
  return lists;
}

TEST(TileBins, NothingMakesOneEmptyBand) {
  const Binned binned = bin({}, {}, true, 1, 0);
  EXPECT_TRUE(binned.lists.empty());
  EXPECT_EQ(binned.bands, 1u);
  EXPECT_EQ(binned.pairs, 0u);
}

TEST(TileBins, BoxesAreListedWholeAndInOrder) {
  const std::vector<Splat> splats = random_splats(300, 900);
  const std::vector<DepthSort::Item> sorted = reversed(splats.size());
  const Binned binned = bin(splats, sorted, false, 1, splats.size());
  EXPECT_EQ(binned.lists, boxes(splats, sorted));
  EXPECT_EQ(binned.missed, 0u);
}

TEST(TileBins, ExactListsMissNoTileThatAPixelCentreOfTheEllipseIsIn) {
  const std::vector<Splat> splats = random_splats(200, 900);
  const std::vector<DepthSort::Item> sorted = reversed(splats.size());
  const Binned exact = bin(splats, sorted, true, 1, splats.size());
  const Lists whole = boxes(splats, sorted);
  uint64_t whole_pairs = 0;
  const uint32_t tiles_x = (kWidth + 31) / 32;
  for (const auto& [tile, order] : whole) {
    whole_pairs += order.size();
    for (const uint32_t index : order) {
      const Splat& s = splats[index];
      bool touched = false;
      for (uint32_t i = 0; i < 1024 && !touched; ++i) {
        const float dx = static_cast<float>(tile % tiles_x * 32 + i % 32) + 0.5f - s.mean_x,
                    dy = static_cast<float>(tile / tiles_x * 32 + i / 32) + 0.5f - s.mean_y;
        const float u = (dx - s.slope * dy) * s.scale_u, v = dy * s.scale_v;
        touched = u * u + v * v < s.reach;
      }
      const auto found = exact.lists.find(tile);
      const bool listed = found != exact.lists.end() &&
                          std::count(found->second.begin(), found->second.end(), index) == 1;
      ASSERT_TRUE(listed || !touched) << "splat " << index << ", tile " << tile;
    }
  }
  EXPECT_EQ(exact.pairs + exact.missed, whole_pairs);
  EXPECT_GT(exact.missed, whole_pairs / 20) << "slanted ellipses miss corners of their boxes";
}

TEST(TileBins, AreTheSameForAnyNumberOfThreads) {
  // Enough for three sections.
  const std::vector<Splat> splats = random_splats(30000, 60);
  const std::vector<DepthSort::Item> sorted = reversed(splats.size());
  const Binned one = bin(splats, sorted, true, 1, splats.size());
  for (const uint32_t threads : {2u, 3u}) {
    const Binned more = bin(splats, sorted, true, threads, splats.size());
    EXPECT_EQ(more.lists, one.lists);
    EXPECT_EQ(more.pairs, one.pairs);
    EXPECT_EQ(more.missed, one.missed);
  }
}

TEST(TileBins, MorePairsThanTheListHoldsComeInBands) {
  // 18,000 splats over all 35 tiles are 630,000 pairs; the list holds 72,000.
  std::vector<Splat> splats(18000, ellipse(100, 65, 1e6f, 0, 1e6f));
  const std::vector<DepthSort::Item> sorted = reversed(splats.size());
  for (const uint32_t threads : {1u, 2u}) {
    const Binned binned = bin(splats, sorted, true, threads, splats.size());
    EXPECT_EQ(binned.pairs, 18000u * 35);
    EXPECT_EQ(binned.bands, 9u) << "4 tiles of 18,000 fit";
    EXPECT_EQ(binned.lists, boxes(splats, sorted));
  }
}

}  // namespace
}  // namespace figurine::tile_bins_test
