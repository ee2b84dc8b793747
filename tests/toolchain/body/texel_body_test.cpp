// Texels against closed forms on a square, against brute force on the mannequin, and through the
// package.
#include "toolchain/body/texel_body.h"

#include <cmath>

#include "formats/writer/package_writer.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/test_files.h"
#include "toolchain/error.h"

namespace figurine::body::texel_body_test {
namespace {

constexpr uint32_t kSize = 16;

// A square of 1.6 x 0.8 m in the plane z = 0.3 whose chart is the left half of the atlas, u over
// [0, 0.5], v over [0, 1] downward: the point (x, y) lies at u = x / 3.2, v = 1 - y / 0.8. Joint 1
// takes over from joint 0 along x.
BodyModel square() {
  BodyModel model;
  model.name = "square";
  model.surface.position_m = {0, 0, 0.3f, 1.6f, 0, 0.3f, 1.6f, 0.8f, 0.3f, 0, 0.8f, 0.3f};
  model.surface.uv = {0, 1, 0.5f, 1, 0.5f, 0, 0, 0};
  model.surface.triangles = model.surface.uv_triangles = {0, 1, 2, 0, 2, 3};
  model.surface.hidden = {0, 0};
  model.surface.skin_joints.assign(4 * kSkinInfluences, 0);
  model.surface.skin_weights.assign(4 * kSkinInfluences, 0.0f);
  for (size_t v = 0; v < 4; ++v) {
    model.surface.skin_joints[v * kSkinInfluences] = v == 1 || v == 2 ? 1 : 0;
    model.surface.skin_weights[v * kSkinInfluences] = 1;
  }
  model.shape_count = 1;
  model.vertex_shape_basis_m = {0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0};  // stretches along x
  model.joint_shape_basis_m.assign(3 * kJointCount, 0.0f);
  return model;
}

TEST(TexelBody, SquareIsExact) {
  const TexelBody body = make_texel_body(square(), kSize);
  ASSERT_EQ(body.texel.size(), size_t{kSize} * kSize / 2);
  float worst = 0;
  for (size_t row = 0; row < body.texel.size(); ++row) {
    const uint32_t u = body.texel[row] % kSize, v = body.texel[row] / kSize;
    ASSERT_LT(u, kSize / 2);
    const float x = (static_cast<float>(u) + 0.5f) / kSize * 3.2f,
                y = 0.8f * (1 - (static_cast<float>(v) + 0.5f) / kSize);
    const float wanted[3] = {x, y, 0.3f};
    for (size_t i = 0; i < 3; ++i)
      worst = std::max(worst, std::abs(body.position_m[3 * row + i] - wanted[i]));
    EXPECT_FLOAT_EQ(body.normal[3 * row + 2], 1);
    // Weights go linearly from joint 0 to joint 1.
    for (size_t k = 0; k < 2; ++k) {
      const float share = body.joints[row * kSkinInfluences + k] == 1 ? x / 1.6f : 1 - x / 1.6f;
      worst = std::max(worst, std::abs(body.weights[row * kSkinInfluences + k] - share));
    }
    worst = std::max(worst, std::abs(body.shape_basis_m[3 * row] - x / 1.6f));
    // One texel is 0.2 m along u and 0.05 m along v.
    EXPECT_NEAR(body.spacing_m[row], 0.125, 1e-6);
  }
  std::printf("largest error %.2g\n", double{worst});
  EXPECT_LT(worst, 1e-6);
}

TEST(TexelBody, TopOfTheFigureIsTopOfTheAtlas) {
  const TexelBody body = make_texel_body(square(), kSize);
  EXPECT_GT(body.position_m[1], body.position_m[3 * (body.texel.size() - 1) + 1]);
}

TEST(TexelBody, BorderIsTwoTexelsOfTheNearestRow) {
  const TexelBody body = make_texel_body(square(), kSize);
  ASSERT_EQ(body.border_texel.size(), size_t{2} * kSize);  // only the right edge has room
  for (size_t d = 0; d < body.border_texel.size(); ++d) {
    const uint32_t u = body.border_texel[d] % kSize, v = body.border_texel[d] / kSize;
    EXPECT_TRUE(u == kSize / 2 || u == kSize / 2 + 1);
    EXPECT_EQ(body.texel[body.border_source[d]], v * kSize + kSize / 2 - 1);
  }
}

TEST(TexelBody, HiddenTrianglesHaveNoTexels) {
  BodyModel model = square();
  model.surface.hidden = {0, 1};
  const TexelBody body = make_texel_body(model, kSize);
  for (uint32_t t : body.triangle) EXPECT_EQ(t, 0u);
  EXPECT_LT(body.texel.size(), size_t{kSize} * kSize / 2);
  model.surface.hidden = {1, 1};
  EXPECT_NE(test::input_error([&] { make_texel_body(model, kSize); }).find("no texel"),
            std::string::npos);
}

TEST(TexelBody, RefusesUvsOutsideTheAtlas) {
  BodyModel model = square();
  model.surface.uv[2] = 1.5f;
  EXPECT_NE(
      test::input_error([&] { make_texel_body(model, kSize); }).find("triangle 0 leaves [0,1]"),
      std::string::npos);
  EXPECT_NE(test::input_error([&] { make_texel_body(square(), 4); }).find("uv size 4"),
            std::string::npos);
}

TEST(TexelBody, SpacingIsTheDistanceToNeighbours) {
  const TexelBody body = make_texel_body(make_mannequin(), 128);
  std::vector<int> row_of(128 * 128, -1);
  for (size_t row = 0; row < body.texel.size(); ++row)
    row_of[body.texel[row]] = static_cast<int>(row);
  double sum = 0;
  int count = 0;
  for (size_t row = 0; row < body.texel.size(); ++row) {
    const uint32_t u = body.texel[row] % 128, v = body.texel[row] / 128;
    if (u == 127 || v == 127) continue;
    const int right = row_of[v * 128 + u + 1], below = row_of[(v + 1) * 128 + u];
    if (right < 0 || below < 0) continue;
    const auto distance = [&](int other) {
      double square_sum = 0;
      for (size_t i = 0; i < 3; ++i)
        square_sum += std::pow(double{body.position_m[3 * static_cast<size_t>(other) + i]} -
                                   body.position_m[3 * row + i],
                               2);
      return std::sqrt(square_sum);
    };
    sum += 0.5 * (distance(right) + distance(below)) / double{body.spacing_m[row]};
    ++count;
  }
  std::printf("neighbour distance over spacing, mean %.3f\n", sum / count);
  EXPECT_NEAR(sum / count, 1, 0.03);
}

TEST(TexelBody, BorderSourceIsNearestByBruteForce) {
  const uint32_t size = 64;
  const TexelBody body = make_texel_body(make_mannequin(), size);
  std::vector<bool> covered(size * size, false), border(size * size, false);
  for (uint32_t t : body.texel) covered[t] = true;
  for (size_t d = 0; d < body.border_texel.size(); ++d) {
    const int u = static_cast<int>(body.border_texel[d] % size),
              v = static_cast<int>(body.border_texel[d] / size);
    ASSERT_FALSE(covered[body.border_texel[d]]);
    border[body.border_texel[d]] = true;
    int best = 1 << 30;
    uint32_t best_row = 0;
    for (uint32_t row = 0; row < body.texel.size(); ++row) {
      const int du = static_cast<int>(body.texel[row] % size) - u,
                dv = static_cast<int>(body.texel[row] / size) - v;
      if (du * du + dv * dv < best) {
        best = du * du + dv * dv;
        best_row = row;
      }
    }
    ASSERT_EQ(body.border_source[d], best_row);
  }
  // Every uncovered texel within two steps is border.
  for (int t = 0; t < static_cast<int>(size * size); ++t) {
    if (covered[static_cast<size_t>(t)]) continue;
    bool near = false;
    for (uint32_t other : body.texel) {
      near = near || (std::abs(static_cast<int>(other % size) - t % static_cast<int>(size)) <= 2 &&
                      std::abs(static_cast<int>(other / size) - t / static_cast<int>(size)) <= 2);
    }
    ASSERT_EQ(near, border[static_cast<size_t>(t)]) << t;
  }
}

TEST(TexelBody, SurvivesThePackage) {
  const BodyModel model = make_mannequin();
  const TexelBody texels = make_texel_body(model, 32);
  const auto bytes = write_package(texels.view(), model.provenance);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  EXPECT_EQ(*bytes, *write_package(make_texel_body(make_mannequin(), 32).view(),
                                   model.provenance));  // the same bytes again
  std::vector<std::byte> room(bytes->size() + 64);
  auto* aligned =
      reinterpret_cast<std::byte*>((reinterpret_cast<uintptr_t>(room.data()) + 63) / 64 * 64);
  std::copy(bytes->begin(), bytes->end(), aligned);
  const auto package = Package::open({aligned, bytes->size()}, "mannequin");
  ASSERT_TRUE(package.ok()) << package.status().message();
  EXPECT_EQ(package->body().texel_count(), texels.texel.size());
  EXPECT_EQ(package->body().shape_count(), kMannequinShapeCount);
  EXPECT_TRUE(std::equal(texels.position_m.begin(), texels.position_m.end(),
                         package->body().texel_position_m.begin()));
}

}  // namespace
}  // namespace figurine::body::texel_body_test
