// Errors over the foreground of either picture: by hand, and the fast comparison is the plain one.
#include "toolchain/measure/union_error.h"

#include <gtest/gtest.h>

#include "runtime/test_packages.h"

namespace figurine::measure::union_error_test {
namespace {

Picture random_picture(tests::Random& random) {
  Picture picture{12, 10, {}};
  for (size_t i = 0; i < 120; ++i) {
    const auto alpha =
        static_cast<uint8_t>(random.uniform(0, 1) < 0.5f ? 0 : random.uniform(0, 256));
    for (int c = 0; c < 3; ++c)
      picture.rgba.push_back(static_cast<uint8_t>(random.uniform(0, float(alpha) + 1)));
    picture.rgba.push_back(alpha);
  }
  return picture;
}

TEST(UnionError, CountsBothForegroundsOverGrey) {
  Picture a{3, 1, {255, 255, 255, 255, 0, 0, 0, 0, 0, 0, 0, 100}};
  const Picture b{3, 1, {255, 255, 255, 255, 255, 255, 255, 255, 90, 0, 0, 100}};
  const SquaredError error = union_error(
      a, b);  // the first is equal, the second white against grey, the third nobody's foreground
  EXPECT_EQ(error.count, 6u);
  EXPECT_NEAR(error.sum, 3 * 0.25, 1e-12);
  EXPECT_EQ(union_error(b, a).sum, error.sum);
  EXPECT_EQ(union_error(a, a).sum, 0);
}

TEST(ComparedPictures, EqualThePlainComparison) {
  tests::Random random(3);
  std::vector<std::vector<Picture>> members(4);
  for (auto& own : members) own = {random_picture(random), random_picture(random)};
  const ComparedPictures compared(members);
  for (size_t a = 0; a < members.size(); ++a) {
    for (size_t b = 0; b < members.size(); ++b) {
      const SquaredError wanted = union_error(members[a], members[b]), found = compared.error(a, b);
      EXPECT_EQ(found.count, wanted.count);
      EXPECT_NEAR(found.sum, wanted.sum, 1e-12 * (1 + wanted.sum));
    }
  }
}

}  // namespace
}  // namespace figurine::measure::union_error_test
