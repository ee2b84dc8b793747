// Mixtures of members: a mixture's ends are the members themselves.
#include "toolchain/members/mixtures.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "runtime/test_packages.h"

namespace figurine::members::mixtures_test {
namespace {

using tests::make_test_avatar;
using tests::make_test_body;

TEST(Mix, EndsAreTheMembers) {
  const tests::SyntheticBody body = make_test_body();
  const tests::SyntheticAvatar one = make_test_avatar(body, {.shape = {1, 0}, .seed = 1}),
                               two = make_test_avatar(body, {.shape = {0, 3}, .seed = 2});
  const Avatar &a = one.package->avatar(), &b = two.package->avatar();
  const measure::WeightLayout layout(a.network, a.shape.size());
  measure::WeightStorage storage;
  EXPECT_TRUE(std::ranges::equal(mix(layout, a, b, 0, storage).network.layers[0].weights,
                                 a.network.layers[0].weights));
  EXPECT_TRUE(std::ranges::equal(mix(layout, a, b, 1, storage).network.layers[0].weights,
                                 b.network.layers[0].weights));
  const Avatar middle = mix(layout, a, b, 0.5, storage);
  EXPECT_FLOAT_EQ(middle.network.layers[0].bias[0],
                  0.5f * (a.network.layers[0].bias[0] + b.network.layers[0].bias[0]));
  EXPECT_FLOAT_EQ(middle.shape[0], 0.5f);
  EXPECT_FLOAT_EQ(middle.shape[1], 1.5f);
}

}  // namespace
}  // namespace figurine::members::mixtures_test
