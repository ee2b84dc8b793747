// Strain and folds against shapes that are known in closed form: flat strips that are squeezed,
// stretched, turned and crumpled.
#include "toolchain/capture/folds.h"

#include <algorithm>
#include <cmath>

#include "gtest/gtest.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/capture/cloth_strength.h"
#include "toolchain/capture/renderer.h"

namespace figurine::capture::folds_test {
namespace {

constexpr uint32_t kColumns = 40, kRows = 40;
constexpr float kStep_m = 0.015f;

// A square of cloth, 60 cm wide, lying level (so that slack has nothing to hang down), normals up.
Mesh sheet(float strength = 1) {
  Mesh mesh;
  mesh.name = "sheet";
  for (uint32_t j = 0; j <= kRows; ++j) {
    for (uint32_t i = 0; i <= kColumns; ++i) {
      mesh.position_m.insert(mesh.position_m.end(), {kStep_m * static_cast<float>(i), 0,
                                                     -kStep_m * static_cast<float>(j)});
    }
  }
  for (uint32_t j = 0; j < kRows; ++j) {
    for (uint32_t i = 0; i < kColumns; ++i) {
      const uint32_t a = j * (kColumns + 1) + i, b = a + 1, c = a + kColumns + 1, d = c + 1;
      mesh.triangles.insert(mesh.triangles.end(), {a, b, d, a, d, c});
    }
  }
  mesh.uv = {0.5f, 0.5f};
  mesh.uv_triangles.assign(mesh.triangles.size(), 0);
  mesh.skin_joints.assign(size_t{mesh.vertex_count()} * kSkinInfluences, 0);
  mesh.skin_weights.assign(size_t{mesh.vertex_count()} * kSkinInfluences, 0);
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v)
    mesh.skin_weights[size_t{v} * kSkinInfluences] = 1;
  mesh.fold_strength.assign(mesh.vertex_count(), strength);
  return mesh;
}

template <class Map>
std::vector<float> moved(const Mesh& mesh, Map map) {
  std::vector<float> out;
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    const Vec3 p = map(load(&mesh.position_m[size_t{v} * 3]));
    out.insert(out.end(), {p.x, p.y, p.z});
  }
  return out;
}

std::vector<float> scaled(const Mesh& mesh, float x, float z) {
  return moved(mesh, [&](Vec3 p) { return Vec3{p.x * x, p.y, p.z * z}; });
}

constexpr FoldStyle kStyle{.wavelength_m = 0.04f, .slack = 0.02f, .strength = 1};

float largest_height(const std::vector<FoldSample>& samples) {
  float most = 0;
  for (const FoldSample& sample : samples) most = std::max(most, std::fabs(sample.height_m));
  return most;
}

TEST(Strain, OfASqueezedStripIsKnown) {
  const Mesh mesh = sheet();
  for (const Strain& e :
       StrainGauge(mesh.position_m, mesh.triangles).measure(scaled(mesh, 0.8f, 1.1f))) {
    // Green's strain: (stretch^2 - 1) / 2.
    EXPECT_NEAR(e.xx, (0.64f - 1) / 2, 1e-5f);
    EXPECT_NEAR(e.zz, (1.21f - 1) / 2, 1e-5f);
    EXPECT_NEAR(e.zx, 0, 1e-5f);
    EXPECT_NEAR(e.yy, 0, 1e-5f);
  }
}

TEST(Strain, CompressionLiesAlongTheSqueeze) {
  const Mesh mesh = sheet();
  // Squeezed by a fifth along a direction 30 degrees from x.
  const Vec3 d{std::cos(0.5235988f), 0, std::sin(0.5235988f)};
  const std::vector<float> posed = moved(mesh, [&](Vec3 p) { return p - d * (0.2f * dot(p, d)); });
  for (const Strain& e : StrainGauge(mesh.position_m, mesh.triangles).measure(posed)) {
    const Compression c = principal_compression(e, {1, 0, 0}, {0, 0, -1});
    ASSERT_NEAR(c.along, 0.2f, 1e-4f);
    ASSERT_NEAR(c.across, 0, 1e-4f);
    ASSERT_NEAR(std::fabs(dot(c.direction, d)), 1, 1e-4f);
  }
}

TEST(Folds, RigidMotionGivesNone) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 1);
  EXPECT_GT(pattern.crease_count(), 100u);
  const float c = std::cos(2.0f), s = std::sin(2.0f);
  const std::vector<float> turned = moved(
      mesh, [&](Vec3 p) { return Vec3{c * p.x - s * p.y + 3, s * p.x + c * p.y - 1, p.z + 2}; });
  EXPECT_LT(largest_height(pattern.evaluate(mesh.position_m)), 1e-9f);
  EXPECT_LT(largest_height(pattern.evaluate(turned)), 2e-5f) << "rounding of positions 3 m away";
}

TEST(Folds, PureStretchGivesNone) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 1);
  EXPECT_EQ(largest_height(pattern.evaluate(scaled(mesh, 1.2f, 1.0f))), 0);
  EXPECT_EQ(largest_height(pattern.evaluate(scaled(mesh, 1.3f, 1.1f))), 0);
}

// What hangs gathers a little even at rest; stretched by more than its slack, it does not.
TEST(Folds, SlackGathersUprightClothUntilItIsStretched) {
  Mesh mesh = sheet();
  for (size_t i = 0; i < mesh.position_m.size(); i += 3)
    std::swap(mesh.position_m[i + 1], mesh.position_m[i + 2]);
  const FoldPattern pattern(mesh, kStyle, 1);
  EXPECT_GT(largest_height(pattern.evaluate(mesh.position_m)), 2e-4f);
  EXPECT_EQ(largest_height(
                pattern.evaluate(moved(mesh, [](Vec3 p) { return Vec3{p.x, p.y * 1.05f, p.z}; }))),
            0);
}

// A strip squeezed by c keeps its length in folds of mean square slope 2 c (to first order), across
// the squeeze.
TEST(Folds, SqueezedStripKeepsItsLengthAcrossTheSqueeze) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 3);
  double along = 0, across = 0, mean = 0;
  size_t count = 0;
  const std::vector<FoldSample> samples = pattern.evaluate(scaled(mesh, 0.9f, 1.0f));
  for (uint32_t j = 10; j < 30; ++j) {
    for (uint32_t i = 10; i < 30; ++i) {
      const FoldSample f = pattern.at(samples, 2 * (j * kColumns + i), 0.3f, 0.3f);
      along += double{f.gradient.x} * f.gradient.x;
      across += double{f.gradient.z} * f.gradient.z;
      mean += f.height_m;
      ++count;
    }
  }
  const double slope2 = along / static_cast<double>(count);
  std::printf(
      "mean square slope %.3f along the squeeze, %.3f across it, for a compression of 0.1; mean "
      "height %.2f mm\n",
      slope2, across / static_cast<double>(count), 1e3 * mean / static_cast<double>(count));
  EXPECT_GT(slope2, 0.2 * 0.4) << "less than half the length is kept";
  EXPECT_LT(slope2, 0.2 * 1.8) << "twice the length is made";
  EXPECT_GT(along, 6 * across);
}

TEST(Folds, SmallChangesOfPoseChangeThemLittle) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 1);
  float worst = 0;
  std::vector<FoldSample> before = pattern.evaluate(mesh.position_m);
  // From rest through no direction at all (the same squeeze along both) to a squeeze across:
  // nothing may jump on the way.
  for (int i = 1; i <= 80; ++i) {
    const float t = static_cast<float>(i) / 80;
    const std::vector<FoldSample> now = pattern.evaluate(
        scaled(mesh, 1 - 0.2f * std::min(1.0f, 2 * t), 1 - 0.3f * std::max(0.0f, 2 * t - 1)));
    for (size_t k = 0; k < now.size(); ++k)
      worst = std::max(worst, std::fabs(now[k].height_m - before[k].height_m));
    before = now;
  }
  std::printf("largest change of height between poses 0.5 %% apart: %.2f mm of %.2f mm\n",
              1e3 * static_cast<double>(worst), 1e3 * static_cast<double>(largest_height(before)));
  EXPECT_LT(worst, 0.0025f);
}

TEST(Folds, HeightsAreOneFunctionOnBothSidesOfAnEdge) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 1);
  const std::vector<FoldSample> samples = pattern.evaluate(scaled(mesh, 0.85f, 1.0f));
  // The diagonal a-d: b1 = 0 of the first triangle, b2 = 0 of the second.
  for (uint32_t f = 0; f < mesh.triangle_count(); f += 2) {
    for (float t : {0.0f, 0.21f, 0.5f, 0.77f, 1.0f}) {
      const FoldSample one = pattern.at(samples, f, 0, t), two = pattern.at(samples, f + 1, t, 0);
      ASSERT_NEAR(one.height_m, two.height_m, 1e-6f);
      ASSERT_LT(length(one.gradient - two.gradient), 1e-4f);
    }
  }
}

TEST(Folds, DegenerateFacesAndExtremePosesStayFiniteAndBounded) {
  Mesh mesh = sheet();
  // A face without area, a needle, and vertices that coincide.
  mesh.triangles.insert(mesh.triangles.end(), {5, 5, 6, 10, 11, 12, 20, 20, 20});
  mesh.uv_triangles.resize(mesh.triangles.size(), 0);
  const FoldPattern pattern(mesh, kStyle, 1);
  const std::vector<std::vector<float>> poses = {
      scaled(mesh, 0, 0),
      scaled(mesh, 0, 1),
      scaled(mesh, -1, 1),
      scaled(mesh, 1e-20f, 1e6f),
      scaled(mesh, 1e19f, 0.5f),
      moved(mesh, [](Vec3 p) {
        return Vec3{std::sin(900 * p.x), std::sin(700 * p.z), std::sin(800 * p.x * p.z)};
      })};
  for (const std::vector<float>& pose : poses) {
    std::vector<FoldSample> samples = pattern.evaluate(pose);
    pattern.turn(samples, std::vector<float>(size_t{mesh.vertex_count()} * 9, 0.0f));
    for (const FoldSample& sample : samples) {
      ASSERT_TRUE(std::isfinite(sample.height_m) &&
                  std::isfinite(dot(sample.gradient, sample.gradient)));
      ASSERT_LT(std::fabs(sample.height_m), kStyle.wavelength_m);
    }
  }
}

TEST(Folds, SlopesTurnWithTheSurfaceAndAreLimited) {
  const Mesh mesh = sheet();
  const FoldPattern pattern(mesh, kStyle, 1);
  const std::vector<FoldSample> rest = pattern.evaluate(scaled(mesh, 0.6f, 1));
  std::vector<FoldSample> turned = rest;
  std::vector<float> linear;
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v)
    linear.insert(linear.end(), {0, -1, 0, 1, 0, 0, 0, 0, 1});  // x to y
  pattern.turn(turned, linear);
  for (size_t i = 0; i < rest.size(); ++i) {
    const float steep = length(rest[i].gradient),
                limited = steep / std::sqrt(1 + steep * steep / (1.1f * 1.1f));
    ASSERT_NEAR(length(turned[i].gradient), limited, 1e-5f);
    ASSERT_LT(length(turned[i].gradient), 1.1f);
    ASSERT_NEAR(turned[i].gradient.y * steep, rest[i].gradient.x * limited, 1e-4f);
  }
}

TEST(ClothStrength, FadesAtBordersAndLeavesSmallPartsAlone) {
  const Mesh mesh = sheet();
  const std::vector<float> strength = cloth_strength(mesh, 0.06f);
  const auto at = [&](uint32_t i, uint32_t j) { return strength[j * (kColumns + 1) + i]; };
  EXPECT_EQ(at(0, 7), 0) << "on the border";
  EXPECT_NEAR(at(2, 20), 0.5f, 1e-4f) << "half way into the fade";
  EXPECT_EQ(at(20, 20), 1);
  Mesh button = mesh;
  for (float& x : button.position_m) x *= 0.05f;
  for (float s : cloth_strength(button, 0.001f)) EXPECT_EQ(s, 0);
  Mesh glove = mesh;
  for (size_t v = 0; v < glove.vertex_count(); ++v)
    glove.skin_joints[v * kSkinInfluences] = body::kLeftWrist;
  for (float s : cloth_strength(glove)) EXPECT_EQ(s, 0);
}

// The whole way into pixels: a squeezed sheet is shaded in folds, and not with kRest or kOff, which
// agree on a level sheet.
TEST(Folds, ShowInPicturesOfThePoseAlone) {
  Person person;
  person.meshes.push_back(sheet());
  Mesh& mesh = person.meshes[0];
  ports::ImageU8 grey(2, 2, 3);
  std::fill(grey.pixels.begin(), grey.pixels.end(), uint8_t{128});
  mesh.material.colour = std::make_shared<Texture>(grey, TextureEncoding::kColour);
  mesh.folds = std::make_shared<FoldPattern>(mesh, kStyle, 1);
  Camera camera{
      .width_px = 48, .height_px = 48, .fx_px = 200, .fy_px = 200, .cx_px = 24, .cy_px = 24};
  camera.view_from_world = {1, 0, 0, -0.25f, 0, 0, 1, 0.3f, 0, -1, 0, 2};  // from above
  const auto contrast = [&](FoldMode mode, float squeeze) {
    Renderer renderer(person, mode);
    Affine affine;
    affine.m[0] = squeeze;
    renderer.set_pose(std::vector<Affine>{affine});
    const Rendering image = renderer.render(camera);
    int low = 255, high = 0;
    for (uint32_t y = 16; y < 32; ++y) {
      for (uint32_t x = 16; x < 32; ++x) {
        low = std::min<int>(low, image.colour.at(x, y)[1]);
        high = std::max<int>(high, image.colour.at(x, y)[1]);
      }
    }
    return high - low;
  };
  EXPECT_GT(contrast(FoldMode::kPose, 0.85f), 15);
  EXPECT_LE(contrast(FoldMode::kPose, 1.0f), 2);
  EXPECT_LE(contrast(FoldMode::kRest, 0.85f), 2);
  EXPECT_LE(contrast(FoldMode::kOff, 0.85f), 2);
}

}  // namespace
}  // namespace figurine::capture::folds_test
