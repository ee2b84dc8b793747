// The base mesh, its skin, its joints and its people, against the numbers of
// docs/decisions/0002-body-data.md.
#include "toolchain/body/makehuman.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/skin.h"
#include "toolchain/body/test_files.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/error.h"

namespace figurine::body::makehuman_test {
namespace {

std::string directory() {
  const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
  return environment == nullptr ? "FIGURINE_MAKEHUMAN is not set: run this through scripts/run"
                                : environment;
}

const MakeHuman& makehuman() {
  static const MakeHuman data = MakeHuman::load(directory());
  return data;
}

const BodyModel& model() {
  static const BodyModel body = make_makehuman_model(makehuman());
  return body;
}

std::vector<float> body_part(const std::vector<float>& vertices) {
  return {vertices.begin(), vertices.begin() + MakeHuman::kBodyVertexCount * 3};
}

float height_m(const std::vector<float>& vertices) {
  float low = 1e9f, high = -1e9f;
  for (size_t i = 1; i < MakeHuman::kBodyVertexCount * 3; i += 3) {
    low = std::min(low, vertices[i]);
    high = std::max(high, vertices[i]);
  }
  return high - low;
}

double mean_distance(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); i += 3)
    sum += std::hypot(std::hypot(a[i] - b[i], a[i + 1] - b[i + 1]), a[i + 2] - b[i + 2]);
  return sum / static_cast<double>(a.size() / 3);
}

TEST(MakeHumanMesh, HasTheNumbersOfTheData) {
  ASSERT_EQ(makehuman().quads().size(), 18486u);
  std::set<uint32_t> uvs, vertices;
  size_t body = 0;
  for (const Quad& quad : makehuman().quads()) {
    if (makehuman().group_names()[quad.group] != "body") continue;
    ++body;
    uvs.insert(quad.uv.begin(), quad.uv.end());
    vertices.insert(quad.vertex.begin(), quad.vertex.end());
  }
  EXPECT_EQ(body, 13378u);
  EXPECT_EQ(uvs.size(), 14517u);
  EXPECT_EQ(vertices.size(), 13380u);
  EXPECT_EQ(*vertices.rbegin(), 13379u);
  EXPECT_EQ(makehuman().group_names().size(), 139u);
}

TEST(MakeHumanMesh, BodyIsNineIslandsThreeOfThemHidden) {
  const Surface& surface = model().surface;
  std::vector<uint32_t> parent(surface.uv.size() / 2);
  for (uint32_t i = 0; i < parent.size(); ++i) parent[i] = i;
  const auto find = [&](uint32_t i) {
    while (parent[i] != i) i = parent[i];
    return i;
  };
  for (size_t t = 0; t < surface.uv_triangles.size(); t += 3) {
    for (size_t c = 1; c < 3; ++c)
      parent[find(surface.uv_triangles[t + c])] = find(surface.uv_triangles[t]);
  }
  std::set<uint32_t> all, hidden;
  for (size_t t = 0; t < surface.triangle_count(); ++t) {
    all.insert(find(surface.uv_triangles[3 * t]));
    if (surface.hidden[t]) hidden.insert(find(surface.uv_triangles[3 * t]));
  }
  EXPECT_EQ(all.size(), 9u);
  EXPECT_EQ(hidden.size(), 3u);
  EXPECT_EQ(std::count(surface.hidden.begin(), surface.hidden.end(), 1), 2 * (398 + 293 + 293));
}

TEST(MakeHumanMesh, ChartsCover624PerMilleWithoutOverlap) {
  BodyModel all = model();
  all.surface.hidden.assign(all.surface.hidden.size(), 0);
  const size_t covered = make_texel_body(all, 256).texel.size();
  EXPECT_NEAR(static_cast<double>(covered), 40900, 20);
  EXPECT_EQ(make_texel_body(model(), 128).texel.size(), 9832u);
  // If no triangle lies over another, the triangles' areas add up to the covered area.
  double area = 0;
  const Surface& s = all.surface;
  for (size_t t = 0; t < s.uv_triangles.size(); t += 3) {
    const float* a = &s.uv[2 * size_t{s.uv_triangles[t]}];
    const float* b = &s.uv[2 * size_t{s.uv_triangles[t + 1]}];
    const float* c = &s.uv[2 * size_t{s.uv_triangles[t + 2]}];
    area += 0.5 * std::abs((double{b[0]} - a[0]) * (double{c[1]} - a[1]) -
                           (double{b[1]} - a[1]) * (double{c[0]} - a[0]));
  }
  EXPECT_NEAR(static_cast<double>(covered) / (256 * 256), area, 1e-3);
}

TEST(MakeHumanSkin, EveryVertexHangsOnAtMostFourJoints) {
  for (size_t v = 0; v < MakeHuman::kVertexCount; ++v) {
    float sum = 0;
    for (size_t k = 0; k < kSkinInfluences; ++k) {
      const float w = makehuman().skin_weights()[v * kSkinInfluences + k];
      ASSERT_GE(w, 0);
      if (k >= 4) {
        ASSERT_EQ(w, 0);
      }
      sum += w;
      ASSERT_LT(makehuman().skin_joints()[v * kSkinInfluences + k], kJointCount);
    }
    ASSERT_NEAR(sum, 1, 1e-5);
  }
}

TEST(MakeHumanSkin, EightInfluencesLoseNothingFourLoseAtMost76PerMille) {
  const TexelBody body = make_texel_body(model(), 256);
  EXPECT_LE(body.most_influences, 8u);
  EXPECT_LT(body.largest_lost_weight, 1e-12);  // rounding of a sum
  double lost = 0;
  for (size_t row = 0; row < body.texel.size(); ++row) {
    double rest = 0;
    for (size_t k = 4; k < kSkinInfluences; ++k) rest += body.weights[row * kSkinInfluences + k];
    lost = std::max(lost, rest);
  }
  std::printf("at most %u influences; 4 would lose %.3f\n", body.most_influences, lost);
  EXPECT_LE(lost, 0.0765);
}

TEST(MakeHumanPeople, AreOfPlausibleHeightAndStandOnTheGround) {
  const auto height = [](float gender, float h) {
    return height_m(makehuman().vertices({.gender = gender, .height = h}));
  };
  EXPECT_NEAR(height(0, 0.5f), 1.62, 0.06);
  EXPECT_NEAR(height(1, 0.5f), 1.74, 0.06);
  EXPECT_GT(height(1, 0.55f), height(1, 0.5f) + 0.04);
  EXPECT_LT(height(1, 0.45f), height(1, 0.5f) - 0.02);
  float worst = 0, shortest = 9, tallest = 0;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const std::vector<float> v = makehuman().vertices(sample_macro_shape(seed));
    float low = 9;
    for (size_t i = 1; i < MakeHuman::kBodyVertexCount * 3; i += 3) low = std::min(low, v[i]);
    worst = std::max(worst, std::abs(low));
    shortest = std::min(shortest, height_m(v));
    tallest = std::max(tallest, height_m(v));
  }
  std::printf("50 people from %.2f to %.2f m; soles at most %.1f mm from the ground\n",
              double{shortest}, double{tallest}, 1e3 * double{worst});
  EXPECT_LT(worst, 0.005);
  EXPECT_GT(shortest, 1.40);
  EXPECT_LT(tallest, 2.00);
}

TEST(MakeHumanPeople, AttributesDoWhatTheirNamesSay) {
  const auto girth =
      [](const MacroShape& shape) {  // mean distance of the trunk's vertices from the vertical axis
        const std::vector<float> v = makehuman().vertices(shape);
        double sum = 0;
        int count = 0;
        for (size_t i = 0; i < MakeHuman::kBodyVertexCount * 3; i += 3) {
          if (makehuman().skin_joints()[i / 3 * kSkinInfluences] != kSpine1) continue;
          sum += std::hypot(v[i], v[i + 2]);
          ++count;
        }
        return sum / count;
      };
  EXPECT_GT(girth({.weight = 1}), girth({.weight = 0.5f}) + 0.006);
  EXPECT_LT(girth({.weight = 0}), girth({.weight = 0.5f}) - 0.003);
  // Mixtures are mixtures: half a woman, half a man is the mean of both.
  const std::vector<float> woman = makehuman().vertices({.gender = 0}),
                           man = makehuman().vertices({.gender = 1}),
                           both = makehuman().vertices({});
  double worst = 0;
  for (size_t i = 0; i < both.size(); ++i)
    worst = std::max(worst, std::abs(double{both[i]} - 0.5 * (double{woman[i]} + man[i])));
  EXPECT_LT(worst, 2e-6);
  // Outside the ranges: clamped.
  EXPECT_EQ(makehuman().vertices({.gender = 7}), man);
  EXPECT_EQ(sample_macro_shape(5).weight, sample_macro_shape(5).weight);
  EXPECT_NE(sample_macro_shape(5).weight, sample_macro_shape(6).weight);
}

TEST(MakeHumanPeople, JointsAreSymmetricAndInsideTheBody) {
  const JointPositions joints = makehuman().joints(makehuman().vertices({}));
  for (const auto& [left, right] : {std::pair{kLeftHip, kRightHip},
                                    {kLeftKnee, kRightKnee},
                                    {kLeftWrist, kRightWrist},
                                    {kLeftEye, kRightEye},
                                    {kLeftThumb1, kRightThumb1},
                                    {kLeftFoot, kRightFoot}}) {
    EXPECT_GT(joints[3 * left], 0);
    EXPECT_NEAR(joints[3 * left], -joints[3 * right], 2e-4);
    EXPECT_NEAR(joints[3 * left + 1], joints[3 * right + 1], 2e-4);
  }
  EXPECT_GT(joints[3 * kHead + 1], joints[3 * kNeck + 1]);
  EXPECT_GT(joints[3 * kNeck + 1], joints[3 * kSpine3 + 1]);
  EXPECT_GT(joints[3 * kLeftFoot + 2], joints[3 * kLeftAnkle + 2]);  // toes point to +z
}

TEST(ShapeBasis, HeldOutPeopleAreWithinHalfAMillimetre) {
  ASSERT_EQ(model().shape_count, 20u);
  double vertex_error = 0, joint_error = 0, worst = 0;
  constexpr int kPeople = 60;
  for (int i = 0; i < kPeople; ++i) {
    const std::vector<float> person =
        makehuman().vertices(sample_macro_shape((uint64_t{999} << 32) + static_cast<uint64_t>(i)));
    const std::vector<float> shape = project_shape(model(), body_part(person));
    const double error = mean_distance(shaped_vertices(model(), shape), body_part(person));
    vertex_error += error / kPeople;
    worst = std::max(worst, error);
    const JointPositions got = shaped_joints(model(), shape), wanted = makehuman().joints(person);
    joint_error +=
        mean_distance({got.begin(), got.end()}, {wanted.begin(), wanted.end()}) / kPeople;
  }
  std::printf("held-out people: vertices %.3f mm, joints %.3f mm, worst person %.3f mm\n",
              1e3 * vertex_error, 1e3 * joint_error, 1e3 * worst);
  EXPECT_LT(vertex_error, 0.5e-3);
  EXPECT_LT(joint_error, 0.5e-3);
}

TEST(ShapeBasis, CoefficientsAreInStandardDeviations) {
  double sum[20] = {}, square[20] = {};
  constexpr int kPeople = 200;
  for (int i = 0; i < kPeople; ++i) {
    const std::vector<float> shape = project_shape(
        model(), body_part(makehuman().vertices(
                     sample_macro_shape((uint64_t{1} << 32) + static_cast<uint64_t>(i)))));
    for (int s = 0; s < 20; ++s) {
      sum[s] += shape[static_cast<size_t>(s)];
      square[s] += double{shape[static_cast<size_t>(s)]} * shape[static_cast<size_t>(s)];
    }
  }
  for (int s = 0; s < 20; ++s) {
    EXPECT_NEAR(sum[s] / kPeople, 0, 0.25) << s;
    EXPECT_NEAR(std::sqrt(square[s] / kPeople), 1, 0.25) << s;
  }
}

TEST(ShapeBasis, ProjectionInvertsShaping) {
  std::vector<float> shape(20);
  for (size_t s = 0; s < 20; ++s) shape[s] = 0.1f * static_cast<float>(s) - 1;
  const std::vector<float> back = project_shape(model(), shaped_vertices(model(), shape));
  for (size_t s = 0; s < 20; ++s) EXPECT_NEAR(back[s], shape[s], 2e-3) << s;
}

TEST(MakeHumanLoad, NamesFileAndReason) {
  EXPECT_NE(test::input_error([] {
              MakeHuman::load("/nonexistent");
            }).find("/nonexistent/public/data/models/human_full_size.json: cannot be read"),
            std::string::npos);
  // The package with one file replaced at a time.
  const test::TemporaryFolder folder;
  namespace fs = std::filesystem;
  const std::string targets = "public/data/targets/targets.bin",
                    list = "src/json/targets/target-list.json", rig = "src/json/rigs/default.json",
                    mesh = "public/data/models/human_full_size.json";
  const auto with = [&](const std::string& replaced, const std::string& text) {
    fs::remove_all(folder / "copy");
    for (const std::string& file : {targets, list, rig, mesh}) {
      const fs::path path = fs::path(folder / "copy") / file;
      fs::create_directories(path.parent_path());
      if (file == replaced) {
        test::write_text(path.string(), text);
      } else {
        fs::create_symlink(fs::path(directory()) / file, path);
      }
    }
    return test::input_error([&] { MakeHuman::load(folder / "copy"); });
  };
  EXPECT_NE(with(targets, "short").find("targets.bin: size"), std::string::npos);
  EXPECT_NE(with(list, "{\"targets\": {\"a.target\": []}}")
                .find("target-list.json: targets: 1, expected 1258"),
            std::string::npos);
  EXPECT_NE(with(rig, "{\"bones\": {}, \"joints\": {}}").find("default.json"), std::string::npos);
  EXPECT_NE(with(mesh, "{\"vertices\": [1, 2").find("not valid JSON"), std::string::npos);
  EXPECT_NE(with(mesh, "{\"vertices\": [1, 2]}").find("vertices: 2 values, expected 57474"),
            std::string::npos);
  EXPECT_NE(with(mesh, "{\"vertices\": \"x\"}").find("vertices"), std::string::npos);
}

}  // namespace
}  // namespace figurine::body::makehuman_test
