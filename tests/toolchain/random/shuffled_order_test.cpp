// The order of images, which a resumed run has to repeat.
#include "toolchain/random/shuffled_order.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace figurine::random::shuffled_order_test {
namespace {

TEST(ShuffledOrder, VisitsEveryItemOncePerEpochInAFreshOrder) {
  ShuffledOrder order(7, 100);
  std::vector<size_t> first, second;
  for (uint64_t i = 0; i < 100; ++i) first.push_back(order.item(i));
  for (uint64_t i = 100; i < 200; ++i) second.push_back(order.item(i));
  EXPECT_EQ(std::set<size_t>(first.begin(), first.end()).size(), 100u);
  EXPECT_EQ(std::set<size_t>(second.begin(), second.end()).size(), 100u);
  EXPECT_NE(first, second);
}

TEST(ShuffledOrder, DependsOnIterationAloneNotOnWhatWasAskedBefore) {
  ShuffledOrder straight(3, 41), jumping(3, 41);
  std::vector<size_t> expected;
  for (uint64_t i = 0; i < 200; ++i) expected.push_back(straight.item(i));
  for (uint64_t i : {150u, 3u, 199u, 77u, 150u}) EXPECT_EQ(jumping.item(i), expected[i]);
}

TEST(ShuffledOrder, DiffersBySeed) {
  ShuffledOrder a(1, 1000), b(2, 1000);
  int equal = 0;
  for (uint64_t i = 0; i < 1000; ++i) equal += a.item(i) == b.item(i);
  EXPECT_LT(equal, 20);
}

}  // namespace
}  // namespace figurine::random::shuffled_order_test
