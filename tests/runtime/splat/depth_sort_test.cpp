#include "runtime/src/splat/depth_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "runtime/test_packages.h"

namespace figurine::depth_sort_test {
namespace {

std::vector<DepthSort::Item> sorted(const std::vector<float>& depths, uint32_t threads) {
  ThreadPool pool = std::move(ThreadPool::create(threads)).value();
  DepthSort sort(pool);
  EXPECT_TRUE(sort.ensure(depths.size()));
  for (uint32_t i = 0; i < depths.size(); ++i)
    sort.items()[i] = {std::bit_cast<uint32_t>(depths[i]), i};
  const DepthSort::Item* result = sort.sort(static_cast<uint32_t>(depths.size()));
  return {result, result + depths.size()};
}

void expect_stable_sort(const std::vector<float>& depths, uint32_t threads) {
  std::vector<uint32_t> truth(depths.size());
  for (uint32_t i = 0; i < truth.size(); ++i) truth[i] = i;
  std::stable_sort(truth.begin(), truth.end(),
                   [&](uint32_t a, uint32_t b) { return depths[a] < depths[b]; });
  const std::vector<DepthSort::Item> result = sorted(depths, threads);
  for (size_t i = 0; i < truth.size(); ++i) {
    ASSERT_EQ(result[i].index, truth[i]) << i << " of " << truth.size() << ", " << threads;
    ASSERT_EQ(result[i].depth_bits, std::bit_cast<uint32_t>(depths[truth[i]]));
  }
}

TEST(DepthSort, SortsNothingAndOne) {
  EXPECT_TRUE(sorted({}, 1).empty());
  EXPECT_TRUE(sorted({}, 2).empty());
  EXPECT_EQ(sorted({3}, 2)[0].index, 0u);
}

TEST(DepthSort, IsTheStableSortForAnyNumberOfThreads) {
  tests::Random random(1);
  // Around the lengths where a list begins to be divided, all digits in use, many ties.
  for (const size_t count : {2u, 100u, 16384u, 40000u, 70000u}) {
    std::vector<float> depths(count);
    for (float& depth : depths) {
      const float scale = random.uniform(0, 1) < 0.5f ? 1.0f : 1e4f;
      depth = 0.2f + static_cast<float>(static_cast<int>(random.uniform(0, 3000))) * 1e-3f * scale;
    }
    for (const uint32_t threads : {1u, 2u, 3u}) expect_stable_sort(depths, threads);
  }
}

TEST(DepthSort, NeighbouringFloatsAreTold) {
  std::vector<float> depths;
  float depth = 2.0f;
  for (int i = 0; i < 50; ++i) {
    depths.insert(depths.begin(), depth);
    depth = std::nextafter(depth, 3.0f);
  }
  expect_stable_sort(depths, 1);
}

TEST(DepthSort, EqualDepthsKeepTheirOrder) {
  expect_stable_sort(std::vector<float>(40000, 1.5f), 2);
}

}  // namespace
}  // namespace figurine::depth_sort_test
