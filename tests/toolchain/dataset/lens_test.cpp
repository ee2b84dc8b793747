// Brown and Conrady by hand, and a picture that was bent and straightened again.
#include "toolchain/dataset/lens.h"

#include <gtest/gtest.h>

#include <cmath>

#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::lens_test {
namespace {

constexpr Camera kCamera{
    .width_px = 64, .height_px = 48, .fx_px = 75, .fy_px = 70, .cx_px = 31, .cy_px = 25};

TEST(Lens, MatchesTheEquationTermByTerm) {
  const double x = 0.3, y = -0.2, r2 = 0.13;
  const auto bent = [&](const std::vector<double>& k) { return distort(make_lens(k, "d"), x, y); };
  EXPECT_DOUBLE_EQ(bent({-0.21, 0.08, 0, 0})[0], x * (1 - 0.21 * r2 + 0.08 * r2 * r2));
  EXPECT_DOUBLE_EQ(bent({0, 0, 0.01, 0})[0], x + 2 * 0.01 * x * y);
  EXPECT_DOUBLE_EQ(bent({0, 0, 0.01, 0})[1], y + 0.01 * (r2 + 2 * y * y));
  EXPECT_DOUBLE_EQ(bent({0, 0, 0, 0.01})[0], x + 0.01 * (r2 + 2 * x * x));
  EXPECT_DOUBLE_EQ(bent({0, 0, 0, 0.01})[1], y + 2 * 0.01 * x * y);
  EXPECT_DOUBLE_EQ(bent({0, 0, 0, 0, 0.5})[1], y * (1 + 0.5 * r2 * r2 * r2));
  EXPECT_DOUBLE_EQ(bent({0, 0, 0, 0, 0, 0.1, 0.2, 0.3})[0],
                   x / (1 + r2 * (0.1 + r2 * (0.2 + r2 * 0.3))));
}

TEST(Lens, CountsThatAreNotReadAreNamed) {
  EXPECT_FALSE(make_lens({}, "dist").bends());
  EXPECT_FALSE(make_lens({0, 0, 0, 0, 0}, "dist").bends());
  EXPECT_TRUE(make_lens({0, 0, 0, 0, 0, 0, 0, 1e-3, 0, 0, 0, 0}, "dist").bends());
  const auto refusal = [](std::vector<double> k) {
    return test::input_error([&] { make_lens(k, "a.json: dist"); });
  };
  EXPECT_EQ(refusal({0.1}).find("a.json: dist: has 1 numbers"), 0u);
  EXPECT_NE(refusal(std::vector<double>(12, 0.1)).find("thin prism"), std::string::npos);
  EXPECT_NE(refusal({1e6, 0, 0, 0}).find("no lens"), std::string::npos);
}

TEST(Lens, FoldsAreFound) {
  EXPECT_TRUE(is_one_to_one(kCamera, make_lens({-0.21, 0.08, 0, 0}, "d")));
  EXPECT_FALSE(is_one_to_one(kCamera, make_lens({-3, 0, 0, 0}, "d")));
}

// A picture whose value at a point is a smooth function of the undistorted ray: bent by the
// definition, pixel by pixel, it comes back.
TEST(Lens, StraightensWhatItsOwnEquationBent) {
  const Lens lens = make_lens({-0.21, 0.08, 0.004, -0.003, 0.02}, "d");
  const auto value = [](double x, double y) {
    return 128 + 60 * std::sin(9 * x) + 60 * std::cos(8 * y + 1);
  };
  ports::ImageU8 bent(64, 48, 1), wanted(64, 48, 1);
  for (uint32_t v = 0; v < 48; ++v) {
    for (uint32_t u = 0; u < 64; ++u) {
      const double to_x = (u + 0.5 - 31) / 75, to_y = (v + 0.5 - 25) / 70;
      *wanted.at(u, v) = static_cast<uint8_t>(std::lround(value(to_x, to_y)));
      double x = to_x, y = to_y;  // where the ray came from, by fixed-point iteration
      for (int i = 0; i < 50; ++i) {
        const auto at = distort(lens, x, y);
        x += to_x - at[0], y += to_y - at[1];
      }
      *bent.at(u, v) = static_cast<uint8_t>(std::lround(value(x, y)));
    }
  }
  const ports::ImageU8 straight = undistort(bent, kCamera, lens);
  int largest = 0, ignored = 0;
  for (uint32_t v = 2; v < 46; ++v) {
    for (uint32_t u = 2; u < 62; ++u) {
      largest = std::max(largest, std::abs(*straight.at(u, v) - *wanted.at(u, v)));
      ignored = std::max(ignored, std::abs(*bent.at(u, v) - *wanted.at(u, v)));
    }
  }
  EXPECT_LE(largest, 2) << "rounding twice, and bilinear";
  EXPECT_GE(ignored, 10) << "the distortion is worth something";
}

}  // namespace
}  // namespace figurine::dataset::lens_test
