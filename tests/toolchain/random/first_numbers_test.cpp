// The first numbers of every generator: captures, initial weights, training runs and figures that
// exist were made with them, so another number here is another person, run or figure.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "toolchain/random/counter.h"
#include "toolchain/random/shuffled_order.h"
#include "toolchain/random/split_mix.h"
#include "toolchain/random/stream.h"

namespace figurine::random::first_numbers_test {
namespace {

TEST(FirstNumbers, OfInitialWeights) {
  SplitMix random(1);
  for (const float number : {0x1.10a2dp-3f, 0x1.f75c68p-2f, 0x1.e24e88p-1f, -0x1.c7cf4p-4f})
    EXPECT_EQ(random.signed_unit(), number);
}

TEST(FirstNumbers, OfMakeHumanPeople) {
  SplitMix random(mix_bits(1 + kWeylStep));
  for (const double number : {0x1.7906ac21d0e58p-2, 0x1.e31ad9d27ad9ep-1, 0x1.72becda64fd1p-5})
    EXPECT_EQ(random.unit(), number);
  EXPECT_EQ(random.nearly_normal(), 0x1.1aac404af54bp-2);
}

TEST(FirstNumbers, OfTraining) {
  EXPECT_EQ(random_bits(0, 0, 0), 0x238275bc38fcbe91u);
  EXPECT_EQ(random_bits(1, 2, 3), 0x8568f7c4e53b5a35u);
  EXPECT_EQ(random_bits(7, 201, uint64_t{1} << 40), 0x79603acb4f452ae2u);
  EXPECT_EQ(random_unit(1, 2, 3), 0x1.0ad1eep-1f);
  EXPECT_NEAR(random_normal(7, 201, 3), 0x1.48c7517398c8ap+0, 1e-15);  // as of captures, below
}

TEST(FirstNumbers, OfTheOrderOfTraining) {
  ShuffledOrder order(7, 10);
  const std::array<size_t, 20> expected = {5, 3, 1, 8, 7, 9, 6, 0, 4, 2,
                                           5, 4, 0, 6, 1, 2, 3, 7, 8, 9};
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(order.item(i), expected[i]);
}

TEST(FirstNumbers, OfCaptures) {
  const CounterRandom zero(0, 0), random(42, 3);
  EXPECT_EQ(zero.bits(0), 0x238275bc38fcbe91u);
  EXPECT_EQ(zero.bits(1), 0x7481d35ce3ee588bu);
  EXPECT_EQ(random.bits(0), 0x2ce02c4ee4d2ea09u);
  EXPECT_EQ(random.bits(1), 0x2923d45dd8eb02eeu);
  EXPECT_EQ(random.unit(2), 0x1.c8d3fc70e041fp-1);
  EXPECT_EQ(random.uniform(3, -1, 2), 0x1.5f35644032b6ep+0);
  EXPECT_EQ(random.index(4, 1000), 191u);
  // By libm's logarithm and cosine, which may differ in the last place from one libm to another.
  EXPECT_NEAR(random.normal(5), -0x1.36e3dc61ca284p-1, 1e-15);
}

TEST(FirstNumbers, OfStatistics) {
  const RandomStream stream(7, RandomUse::kChosenMembers, 3);
  const std::array<size_t, 4> integers = {275837, 535331, 862759, 570711};
  for (size_t i = 0; i < integers.size(); ++i) EXPECT_EQ(stream.index(i, 1000000), integers[i]);
  EXPECT_EQ(stream.distinct(4, 50), (std::vector<size_t>{12, 25, 42, 28}));
  std::array<double, 5> normal{};
  stream.fill_normal(normal);
  EXPECT_EQ(normal, (std::array<double, 5>{-0x1.1572aba2f115dp-3, -0x1.9967134a9f69dp+0,
                                           0x1.1d4a54c04c30ep+0, 0x1.6a1d774a3df8ap-4,
                                           0x1.3aa172cc2fa87p-2}));
}

}  // namespace
}  // namespace figurine::random::first_numbers_test
