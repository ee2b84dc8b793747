// The .ply reader on every variety that is found in the wild, against values worked out here; the
// writer by reading back.
#include "ports/gaussians/ply.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "figurine/pose.h"
#include "largest_error.h"
#include "ports/gaussians/ply_text.h"

namespace figurine::ports::ply_test {
namespace {

using tests::make_ply;
using tests::PlyColumn;
using tests::PlyEncoding;
using tests::sample_value;
using tests::standard_columns;

Result<GaussianCloud> read(const std::string& text) {
  return read_gaussian_ply(std::as_bytes(std::span(text)), "x.ply");
}

GaussianCloud read_sound(const std::string& text) {
  Result<GaussianCloud> cloud = read(text);
  EXPECT_TRUE(cloud.ok()) << cloud.status().message();
  return cloud.ok() ? std::move(cloud).value() : GaussianCloud{};
}

// What the definition of the layout says about the sample values.
void expect_sample(const GaussianCloud& cloud, size_t rows, uint32_t degree) {
  ASSERT_EQ(cloud.count(), rows);
  ASSERT_EQ(cloud.sh_degree, degree);
  ASSERT_EQ(cloud.left_out, 0u);
  const uint32_t rest = sh_coefficients(degree) - 1;
  for (size_t i = 0; i < rows; ++i) {
    const auto value = [&](const std::string& name) { return sample_value(i, name); };
    EXPECT_EQ(cloud.position_m[3 * i], static_cast<float>(value("x")));
    EXPECT_EQ(cloud.position_m[3 * i + 1], static_cast<float>(value("y")));
    EXPECT_EQ(cloud.position_m[3 * i + 2], static_cast<float>(value("z")));
    EXPECT_NEAR(cloud.opacity[i], 1 / (1 + std::exp(-value("opacity"))), 1e-7);
    for (uint32_t c = 0; c < 3; ++c) {
      const float* sh = &cloud.sh[3 * i * (rest + 1)];
      EXPECT_EQ(sh[c], static_cast<float>(value("f_dc_" + std::to_string(c))));
      for (uint32_t k = 0; k < rest; ++k) {
        EXPECT_EQ(sh[3 * (k + 1) + c],
                  static_cast<float>(value("f_rest_" + std::to_string(c * rest + k))))
            << "channel-major in the file";
      }
    }
    float q[4];
    for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(value("rot_" + std::to_string(k)));
    const std::array<float, 9> rotation = rotation_from_quaternion(q);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const double expected = rotation[3 * r + c] * std::exp(value("scale_" + std::to_string(c)));
        EXPECT_NEAR(cloud.covariance_factor[9 * i + 3 * r + c], expected, 1e-6 * std::exp(-3));
      }
    }
  }
}

TEST(GaussianPly, ReadsEveryDegreeAndEncoding) {
  for (int degree = 0; degree <= 3; ++degree) {
    for (const PlyEncoding encoding :
         {PlyEncoding::kAscii, PlyEncoding::kLittle, PlyEncoding::kBig}) {
      SCOPED_TRACE(std::to_string(degree) + " " + std::to_string(static_cast<int>(encoding)));
      expect_sample(read_sound(make_ply(standard_columns(degree), 4, encoding, sample_value)), 4,
                    degree);
    }
  }
}

TEST(GaussianPly, ReadsWithoutNormals) {
  expect_sample(
      read_sound(make_ply(standard_columns(3, false), 3, PlyEncoding::kLittle, sample_value)), 3,
      3);
}

TEST(GaussianPly, ReadsAnyOrderOfProperties) {
  std::vector<PlyColumn> columns = standard_columns(2);
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    for (size_t i = columns.size(); i > 1; --i) std::swap(columns[i - 1], columns[random() % i]);
    expect_sample(read_sound(make_ply(columns, 2, PlyEncoding::kLittle, sample_value)), 2, 2);
  }
}

TEST(GaussianPly, ReadsDoublesAndIgnoresExtraProperties) {
  std::vector<PlyColumn> columns = standard_columns(1);
  for (PlyColumn& column : columns) column.type = "double";
  columns.insert(columns.begin() + 2, {"red", "uchar"});
  columns.push_back({"segment", "int"});
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kLittle, PlyEncoding::kBig}) {
    expect_sample(read_sound(make_ply(columns, 3, encoding, sample_value)), 3, 1);
  }
}

TEST(GaussianPly, SkipsElementsBeforeTheVertices) {
  const std::string element = "element camera 2\nproperty float f\nproperty list uchar int ids\n";
  const auto record = [](char count) {
    std::string bytes(4, '\1');
    bytes += count;
    return bytes + std::string(size_t(count) * 4, '\2');
  };
  expect_sample(read_sound(make_ply(standard_columns(0), 3, PlyEncoding::kLittle, sample_value,
                                    element, record(3) + record(0))),
                3, 0);
  expect_sample(read_sound(make_ply(standard_columns(0), 3, PlyEncoding::kAscii, sample_value,
                                    element, "1.5 3 7 8 9\n2.5 0\n")),
                3, 0);
}

TEST(GaussianPly, IgnoresWhatFollowsTheVertices) {
  std::string text = tests::sample_ply(0, 2);
  text.insert(text.find("end_header"), "element face 1\nproperty list uchar int vertex_indices\n");
  expect_sample(read_sound(text + std::string("\3\0\0\0\0\0\0\0\0\0\0\0\0", 13)), 2, 0);
}

TEST(GaussianPly, ReadsCarriageReturns) {
  std::string text = make_ply(standard_columns(0), 2, PlyEncoding::kAscii, sample_value);
  for (size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
    text.insert(at, "\r");
  expect_sample(read_sound(text), 2, 0);
}

TEST(GaussianPly, InfiniteLogitsAreOpaqueAndInvisible) {
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kLittle}) {
    const GaussianCloud cloud = read_sound(
        make_ply(standard_columns(0), 2, encoding, [](size_t row, const std::string& name) {
          return name == "opacity" ? (row == 0 ? 1 : -1) * std::numeric_limits<double>::infinity()
                                   : sample_value(row, name);
        }));
    ASSERT_EQ(cloud.count(), 2u);
    EXPECT_EQ(cloud.opacity[0], 1.0f);
    EXPECT_EQ(cloud.opacity[1], 0.0f);
  }
}

TEST(GaussianPly, LeavesOutAndCountsWhatCannotBeDrawn) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               inf = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<std::string, double>> faults = {
      {"x", nan},        {"y", inf},       {"z", -inf},      {"f_dc_1", nan},
      {"f_rest_4", inf}, {"opacity", nan}, {"scale_2", nan}, {"scale_0", 500},
      {"scale_1", inf},  {"rot_3", nan},   {"rot_0", inf}};
  const GaussianCloud cloud =
      read_sound(make_ply(standard_columns(1), faults.size() + 2, PlyEncoding::kLittle,
                          [&](size_t row, const std::string& name) {
                            if (row < faults.size() && name == faults[row].first)
                              return faults[row].second;
                            return sample_value(row, name);
                          }));
  EXPECT_EQ(cloud.count(), 2u);
  EXPECT_EQ(cloud.left_out, faults.size());
  EXPECT_EQ(cloud.left_out_why, "Gaussian 0: its position is not finite");
}

TEST(GaussianPly, AVanishingScaleIsKept) {
  const GaussianCloud cloud = read_sound(make_ply(
      standard_columns(0), 1, PlyEncoding::kLittle, [](size_t row, const std::string& name) {
        return name == "scale_1" ? -std::numeric_limits<double>::infinity()
                                 : sample_value(row, name);
      }));
  EXPECT_EQ(cloud.count(), 1u);
}

// F and what the file gave back may differ by a rotation from the right: covariances are compared,
// each against its own size.
TEST(GaussianPly, WritingAndReadingKeepsTheGaussians) {
  std::mt19937 random(11);
  std::normal_distribution<float> normal;
  for (uint32_t degree = 0; degree <= 3; ++degree) {
    GaussianCloud cloud{.sh_degree = degree};
    constexpr uint32_t kCount = 500;
    for (uint32_t i = 0; i < kCount; ++i) {
      for (int k = 0; k < 3; ++k) cloud.position_m.push_back(normal(random));
      const float stretch =
          std::pow(10.0f, static_cast<float>(i % 5) - 3);  // balls to needles and discs of 1:1000
      for (int k = 0; k < 9; ++k)
        cloud.covariance_factor.push_back(0.01f * normal(random) * (k % 3 == 0 ? 1 : stretch));
      cloud.opacity.push_back(static_cast<float>(i) / (kCount - 1));  // 0 and 1 included
      for (uint32_t k = 0; k < 3 * sh_coefficients(degree); ++k) cloud.sh.push_back(normal(random));
    }
    const std::vector<std::byte> bytes = write_gaussian_ply(cloud.view());
    const Result<GaussianCloud> back = read_gaussian_ply(bytes, "x.ply");
    ASSERT_TRUE(back.ok()) << back.status().message();
    ASSERT_EQ(back->count(), kCount);
    EXPECT_EQ(back->position_m, cloud.position_m);
    EXPECT_EQ(back->sh, cloud.sh);
    LargestError opacity("opacity through a file"),
        covariance("covariance through a file, relative to its largest entry");
    for (uint32_t i = 0; i < kCount; ++i) {
      opacity.add(back->opacity[i], cloud.opacity[i]);
      const auto entry = [&](const std::vector<float>& factors, int r, int c) {
        double sum = 0;
        for (int k = 0; k < 3; ++k)
          sum += double(factors[9 * i + 3 * r + k]) * factors[9 * i + 3 * c + k];
        return sum;
      };
      double largest = 0;
      for (int k = 0; k < 3; ++k) largest = std::max(largest, entry(cloud.covariance_factor, k, k));
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c)
          covariance.add(entry(back->covariance_factor, r, c) / largest,
                         entry(cloud.covariance_factor, r, c) / largest);
      }
    }
    EXPECT_LE(opacity.largest(), 3e-7);     // a logit of 16 in float
    EXPECT_LE(covariance.largest(), 4e-6);  // a log scale near -10 in float has a step of 1e-6
  }
}

TEST(GaussianPly, WritesTheStandardLayout) {
  const GaussianCloud cloud{.sh_degree = 3,
                            .position_m = {1, 2, 3},
                            .covariance_factor = {0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0.1f},
                            .opacity = {0.5f},
                            .sh = std::vector<float>(48, 0.25f)};
  const std::vector<std::byte> bytes = write_gaussian_ply(cloud.view());
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const size_t header = text.find("end_header\n") + 11;
  EXPECT_EQ(bytes.size() - header, 62 * sizeof(float));
  const char* order[] = {"float x\n",         "float y\n",       "float z\n",
                         "float nx\n",        "float f_dc_0\n",  "float f_rest_0\n",
                         "float f_rest_44\n", "float opacity\n", "float scale_0\n",
                         "float rot_0\n",     "float rot_3\n"};
  size_t at = 0;
  for (const char* property : order) {
    const size_t found = text.find(property, at);
    ASSERT_NE(found, std::string::npos) << property;
    at = found;
  }
  EXPECT_EQ(text.find("comment"), std::string::npos);
}

TEST(GaussianPly, WritesCommentsThatReadersSkip) {
  const GaussianCloud cloud{.position_m = {1, 2, 3},
                            .covariance_factor = {0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0.1f},
                            .opacity = {0.5f},
                            .sh = {1, 2, 3}};
  const std::vector<std::byte> bytes =
      write_gaussian_ply(cloud.view(), {.comments = {"one", "property float y"}});
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  EXPECT_NE(text.find("1.0\ncomment one\ncomment property float y\nelement vertex 1\n"),
            std::string::npos);
  const GaussianCloud back = read_sound(text);
  EXPECT_EQ(back.position_m, cloud.position_m);
  EXPECT_EQ(back.sh, cloud.sh);
}

}  // namespace
}  // namespace figurine::ports::ply_test
