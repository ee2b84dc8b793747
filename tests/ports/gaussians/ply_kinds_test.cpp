// The kinds of .ply that trainers and editors write, beside the plain one: each read as its maker
// means it, against values worked out here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ports/gaussians/ply.h"
#include "ports/gaussians/ply_text.h"

namespace figurine::ports::ply_kinds_test {
namespace {

using tests::make_ply;
using tests::PlyColumn;
using tests::PlyEncoding;
using tests::sample_value;
using tests::standard_columns;

GaussianCloud read_sound(const std::string& text) {
  Result<GaussianCloud> cloud = read_gaussian_ply(std::as_bytes(std::span(text)), "x.ply");
  EXPECT_TRUE(cloud.ok()) << cloud.status().message();
  return cloud.ok() ? std::move(cloud).value() : GaussianCloud{};
}

std::string with_comment(const std::string& comment) {
  return tests::sample_ply(0, 2).replace(0, 4, "ply\ncomment " + comment + "\n");
}

bool has_remark(const GaussianCloud& cloud, const std::string& words) {
  return std::any_of(cloud.remarks.begin(), cloud.remarks.end(), [&](const std::string& remark) {
    return remark.find(words) != std::string::npos;
  });
}

// The diagonal of F F^T: free of the order and sign of axes.
double variance(const GaussianCloud& cloud, size_t i, size_t axis) {
  double sum = 0;
  for (size_t k = 0; k < 3; ++k)
    sum += double(cloud.covariance_factor[9 * i + 3 * axis + k]) *
           cloud.covariance_factor[9 * i + 3 * axis + k];
  return sum;
}

std::vector<PlyColumn> without(std::vector<PlyColumn> columns, const std::string& name) {
  std::erase_if(columns, [&](const PlyColumn& column) { return column.name == name; });
  return columns;
}

TEST(PlyOrigin, DoublesFarAwayKeepTheirDigits) {
  std::vector<PlyColumn> columns = standard_columns(0);
  for (size_t k = 0; k < 3; ++k) columns[k].type = "double";
  const auto far = [](size_t row, const std::string& name) {
    const double near = sample_value(row, name);
    return name == "x" ? 500000 + near : name == "y" ? 4649776 + near : near;
  };
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kLittle}) {
    const GaussianCloud cloud = read_sound(make_ply(columns, 9, encoding, far));
    EXPECT_NEAR(cloud.origin_m[0], 500000, 1);
    EXPECT_NEAR(cloud.origin_m[1], 4649776, 1);
    EXPECT_NEAR(cloud.origin_m[2], 0, 1);
    for (size_t i = 0; i < 9; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        const std::string axis(1, static_cast<char>('x' + k));
        EXPECT_EQ(cloud.origin_m[k] + double(cloud.position_m[3 * i + k]), far(i, axis));
      }
    }
  }
}

TEST(PlyOrigin, FloatsFarAwayStayExactAndNearOnesStayAsTheyAre) {
  const auto at = [](double offset) {
    return make_ply(standard_columns(0), 9, PlyEncoding::kLittle,
                    [=](size_t row, const std::string& name) {
                      return sample_value(row, name) + (name == "z" ? offset : 0);
                    });
  };
  const GaussianCloud near = read_sound(at(0)), middle = read_sound(at(60)),
                      far = read_sound(at(-2000));
  EXPECT_EQ(near.origin_m, (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(middle.origin_m, (std::array<double, 3>{0, 0, 0}));
  EXPECT_NEAR(far.origin_m[2], -2000, 1);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(far.origin_m[2] + double(far.position_m[3 * i + 2]),
              double(static_cast<float>(sample_value(i, "z") - 2000)));
  }
}

// One stray does not draw the origin away.
TEST(PlyOrigin, IsTheMiddleOfTheMass) {
  const GaussianCloud cloud = read_sound(make_ply(
      standard_columns(0), 9, PlyEncoding::kLittle, [](size_t row, const std::string& name) {
        return name == "x" && row < 2 ? 1e30 : sample_value(row, name);
      }));
  EXPECT_EQ(cloud.count(), 9u);
  EXPECT_EQ(cloud.origin_m[0], 0);
  EXPECT_EQ(cloud.position_m[0], 1e30f);
}

TEST(PlyOrigin, IsKeptByTheWriter) {
  std::vector<PlyColumn> columns = standard_columns(1);
  for (size_t k = 0; k < 3; ++k) columns[k].type = "double";
  const GaussianCloud cloud = read_sound(
      make_ply(columns, 7, PlyEncoding::kLittle, [](size_t row, const std::string& name) {
        return sample_value(row, name) + (name == "x" ? 7e6 : 0);
      }));
  const std::vector<std::byte> bytes =
      write_gaussian_ply(cloud.view(), {.origin_m = cloud.origin_m});
  const Result<GaussianCloud> back = read_gaussian_ply(bytes, "x.ply");
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ(back->origin_m, cloud.origin_m);
  EXPECT_EQ(back->position_m, cloud.position_m);
}

// Of Mip-Splatting's create_fused_ply: scales sqrt(s^2 + f^2), opacity times the root of the ratio
// of determinants.
TEST(PlyFilter3d, IsFusedAsItsAuthorsDo) {
  std::vector<PlyColumn> columns = standard_columns(0);
  columns.push_back({"filter_3D"});
  const auto value = [](size_t row, const std::string& name) {
    if (name.starts_with("rot_")) return name == "rot_0" ? 1.0 : 0.0;
    return name == "filter_3D" ? 0.03125 * double(row) : sample_value(row, name);
  };
  const GaussianCloud cloud = read_sound(make_ply(columns, 4, PlyEncoding::kLittle, value));
  ASSERT_EQ(cloud.count(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    const double filter = value(i, "filter_3D");
    double ratio = 1;
    for (size_t k = 0; k < 3; ++k) {
      const double squared = std::exp(2 * value(i, "scale_" + std::to_string(k)));
      EXPECT_NEAR(variance(cloud, i, k) / (squared + filter * filter), 1, 1e-6);
      ratio *= squared / (squared + filter * filter);
    }
    const double opacity = 1 / (1 + std::exp(-value(i, "opacity")));
    EXPECT_NEAR(cloud.opacity[i], opacity * std::sqrt(ratio), 1e-6);
  }
  EXPECT_TRUE(has_remark(cloud, "filter_3D fused"));
  EXPECT_TRUE(cloud.antialiased) << "its trainer has the 2D filter as well";
}

TEST(PlyComments, SayWhetherScenesAreAntialiased) {
  const std::pair<const char*, bool> kCases[] = {
      {"SplatRenderMode: mip", true},
      {"splatrendermode: MIP ", true},
      {"SplatRenderMode: default", false},
      {"antialiased 1", true},
      {"antialiased 0", false},
      {"antialiased", true},
      {"Antialiased: true", true},
      {"antialiased: false", false},
      {"antialiased: trained with Mip-Splatting's 2D filter", true},
      {"rasterize_mode: antialiased", true},
      {"rasterize_mode: classic", false},
      {"not antialiased 1", false},
      {"antialiasedness 1", false},
      {"SplatRenderMode: mip\ncomment SplatRenderMode: default", false},
      {"SplatRenderMode: default\ncomment antialiased 1", true},
  };
  for (const auto& [comment, antialiased] : kCases)
    EXPECT_EQ(read_sound(with_comment(comment)).antialiased, antialiased) << comment;
  EXPECT_TRUE(
      read_sound(with_comment("x").replace(4, 9, "obj_info antialiased 1\ncomment ")).antialiased);
}

TEST(PlyComments, SayWhatIsUp) {
  const std::pair<const char*, std::optional<UpAxis>> kCases[] = {
      {"Vertical Axis: z", UpAxis::kPlusZ},
      {"Vertical axis: x", UpAxis::kPlusX},
      {"Vertical axis: y", std::nullopt},
      {"Vertical axis: 0 -1 0", UpAxis::kMinusY},
      {"Vertical axis: 0.1 0.9 -0.2", UpAxis::kPlusY},
      {"Vertical axis: 0 0 -1.0", UpAxis::kMinusZ},
      {"Vertical axis: -1 0 0", UpAxis::kMinusX},
      {"Vertical axis: 0 0 0", std::nullopt},
      {"Vertical axis: 0 nan 0", std::nullopt},
      {"Vertical axis: 0 1", std::nullopt},
      {"something else", std::nullopt},
  };
  for (const auto& [comment, up] : kCases)
    EXPECT_EQ(read_sound(with_comment(comment)).up, up) << comment;
  EXPECT_EQ(read_sound(with_comment("x")).up_axis(), UpAxis::kMinusY) << "assumed";
}

TEST(PlyComments, OfOurOwnAreReadBack) {
  for (const UpAxis up : {UpAxis::kPlusX, UpAxis::kMinusX, UpAxis::kPlusY, UpAxis::kMinusY,
                          UpAxis::kPlusZ, UpAxis::kMinusZ}) {
    for (const bool antialiased : {false, true}) {
      const GaussianCloud cloud = read_sound(tests::sample_ply(0, 2));
      const std::vector<std::byte> bytes =
          write_gaussian_ply(cloud.view(), {.comments = drawing_comments(antialiased, up)});
      const Result<GaussianCloud> back = read_gaussian_ply(bytes, "x.ply");
      ASSERT_TRUE(back.ok());
      EXPECT_EQ(back->up, up);
      EXPECT_EQ(back->antialiased, antialiased);
    }
  }
  EXPECT_EQ(drawing_comments(false, std::nullopt).size(), 1u) << "what was assumed is not said";
}

TEST(PlyFlat, TwoScalesAreDiscs) {
  const std::vector<PlyColumn> columns = without(standard_columns(0), "scale_2");
  const GaussianCloud disc = read_sound(make_ply(columns, 3, PlyEncoding::kLittle, sample_value));
  const GaussianCloud full =
      read_sound(make_ply(standard_columns(0), 3, PlyEncoding::kLittle, sample_value));
  ASSERT_EQ(disc.count(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t row = 0; row < 3; ++row) {
      for (size_t axis = 0; axis < 2; ++axis) {
        EXPECT_EQ(disc.covariance_factor[9 * i + 3 * row + axis],
                  full.covariance_factor[9 * i + 3 * row + axis]);
      }
      EXPECT_EQ(disc.covariance_factor[9 * i + 3 * row + 2], 0) << "no extent along the normal";
    }
  }
  EXPECT_TRUE(has_remark(disc, "discs"));
  const GaussianCloud said =
      read_sound(make_ply(standard_columns(0), 3, PlyEncoding::kLittle, sample_value)
                     .replace(0, 4, "ply\ncomment SplatRenderMode: 2dgs\n"));
  EXPECT_EQ(said.covariance_factor, disc.covariance_factor);
}

TEST(PlyShape, OneScaleIsTheSameAlongAllAxes) {
  std::vector<PlyColumn> columns = without(without(standard_columns(0), "scale_2"), "scale_1");
  for (int k = 0; k < 4; ++k) columns = without(columns, "rot_" + std::to_string(k));
  const GaussianCloud cloud = read_sound(make_ply(columns, 2, PlyEncoding::kLittle, sample_value));
  ASSERT_EQ(cloud.count(), 2u);
  for (size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(variance(cloud, 1, k), std::exp(2 * sample_value(1, "scale_0")), 1e-8);
  EXPECT_TRUE(has_remark(cloud, "one scale"));
}

TEST(PlyShape, NoRotationIsTheIdentityAndCounted) {
  const GaussianCloud cloud = read_sound(make_ply(
      standard_columns(0), 3, PlyEncoding::kLittle, [](size_t row, const std::string& name) {
        return name.starts_with("rot_") && row < 2 ? 0 : sample_value(row, name);
      }));
  EXPECT_EQ(cloud.count(), 3u);
  EXPECT_EQ(cloud.left_out, 0u);
  EXPECT_TRUE(has_remark(cloud, "2 without a rotation"));
  for (size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(variance(cloud, 0, k), std::exp(2 * sample_value(0, "scale_" + std::to_string(k))),
                1e-8);
}

TEST(PlyShape, TinyAndHugeQuaternionsAreRotations) {
  for (const double length : {1e-300, 1e-30, 1.0, 1e30, 1e300}) {
    std::vector<PlyColumn> columns = standard_columns(0);
    for (PlyColumn& column : columns) column.type = "double";
    const GaussianCloud cloud = read_sound(
        make_ply(columns, 1, PlyEncoding::kLittle, [=](size_t row, const std::string& name) {
          return sample_value(row, name) * (name.starts_with("rot_") ? length : 1);
        }));
    const GaussianCloud plain =
        read_sound(make_ply(columns, 1, PlyEncoding::kLittle, sample_value));
    ASSERT_EQ(cloud.count(), 1u) << length;
    for (size_t k = 0; k < 9; ++k)
      EXPECT_NEAR(cloud.covariance_factor[k], plain.covariance_factor[k], 1e-8) << length;
  }
}

TEST(PlyColour, RedGreenBlueInPlaceOfHarmonics) {
  std::vector<PlyColumn> columns = standard_columns(0);
  for (int k = 0; k < 3; ++k) columns = without(columns, "f_dc_" + std::to_string(k));
  const auto colour = [](size_t row, const std::string& name) {
    return name == "red"     ? 255
           : name == "green" ? 0
           : name == "blue"  ? 51
                             : sample_value(row, name);
  };
  for (const char* type : {"uchar", "float"}) {
    std::vector<PlyColumn> coloured = columns;
    for (const char* name : {"red", "green", "blue"}) coloured.push_back({name, type});
    const double one = std::string(type) == "float" ? 255 : 1;
    const GaussianCloud cloud = read_sound(
        make_ply(coloured, 2, PlyEncoding::kLittle, [&](size_t row, const std::string& name) {
          const double value = colour(row, name);
          return name == "red" || name == "blue" ? value / one : value;
        }));
    ASSERT_EQ(cloud.count(), 2u);
    const float expected[3] = {1, 0, 0.2f};
    for (size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(cloud.sh[k] * kSh0 + kShOffset, expected[k], 1e-6) << type;
    EXPECT_TRUE(has_remark(cloud, "red green blue"));
  }
}

TEST(PlyHarmonics, BandsBeyondTheThirdAndHalfBandsAreSaid) {
  const auto read_rest = [](size_t values) {
    std::vector<PlyColumn> columns = standard_columns(0);
    for (size_t k = 0; k < values; ++k) columns.push_back({"f_rest_" + std::to_string(k)});
    return read_sound(make_ply(columns, 2, PlyEncoding::kLittle, sample_value));
  };
  const GaussianCloud fourth = read_rest(72), half = read_rest(30), less = read_rest(6);
  EXPECT_EQ(fourth.sh_degree, 3u);
  EXPECT_TRUE(has_remark(fourth, "degree 4, read to degree 3"));
  EXPECT_EQ(half.sh_degree, 2u);
  EXPECT_TRUE(has_remark(half, "11 spherical harmonics a channel, no whole degree, read to"));
  EXPECT_EQ(less.sh_degree, 0u);
  EXPECT_TRUE(has_remark(less, "read to degree 0"));
  for (const auto& [cloud, stored] : {std::pair(&fourth, 24), {&half, 10}}) {
    const size_t width = 3 * sh_coefficients(cloud->sh_degree);
    for (size_t k = 3; k < width; ++k) {  // channel-major in the file
      const size_t column = (k % 3) * size_t(stored) + k / 3 - 1;
      EXPECT_EQ(cloud->sh[width + k],
                static_cast<float>(sample_value(1, "f_rest_" + std::to_string(column))));
    }
  }
}

TEST(PlySkipped, ListsAndUnknownPropertiesAreNamedOnce) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty list uchar int seen\n"
      "property float y\nproperty float z\nproperty float f_dc_0\nproperty float f_dc_1\n"
      "property float f_dc_2\nproperty float opacity\nproperty float scale_0\n"
      "property float scale_1\nproperty float scale_2\nproperty float rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\nproperty uchar label\nend_header\n";
  const GaussianCloud ascii =
      read_sound(header +
                 "1 3 7 8 9 2 3 0 0 0 0 -3 -3 -3 1 0 0 0 5\n4 0 5 6 0 0 0 0 -3 -3 -3 1 0 0 0 "
                 "6\n");
  EXPECT_EQ(ascii.position_m, (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(has_remark(ascii, "skipped 'seen' (a list), 'label'"));

  std::string binary = header;
  binary.replace(binary.find("ascii"), 5, "binary_little_endian");
  const auto add = [&](auto value) {
    binary.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  for (int row = 0; row < 2; ++row) {
    add(float(row == 0 ? 1 : 4));
    const uint8_t items = row == 0 ? 3 : 0;
    add(items);
    for (int k = 0; k < items; ++k) add(int32_t{7});
    for (const float value : {float(row == 0 ? 2 : 5), float(row == 0 ? 3 : 6), 0.f, 0.f, 0.f, 0.f,
                              -3.f, -3.f, -3.f, 1.f, 0.f, 0.f, 0.f})
      add(value);
    add(uint8_t{5});
  }
  EXPECT_EQ(read_sound(binary).position_m, ascii.position_m);
  for (size_t cut = 1; cut < 60; ++cut) {
    const std::string part = binary.substr(0, binary.size() - cut);
    EXPECT_FALSE(read_gaussian_ply(std::as_bytes(std::span(part)), "x.ply").ok()) << cut;
  }
}

TEST(PlySkipped, ManyPropertiesAreCounted) {
  std::vector<PlyColumn> columns = standard_columns(0);
  for (int k = 0; k < 40; ++k) columns.push_back({"semantic_" + std::to_string(k)});
  const GaussianCloud cloud = read_sound(make_ply(columns, 1, PlyEncoding::kLittle, sample_value));
  EXPECT_TRUE(has_remark(cloud, "'semantic_5' and 34 more"));
}

TEST(PlyNumbers, BeyondADoubleGoByTheirSign) {
  const std::string text = tests::sample_ply(0, 3, PlyEncoding::kAscii);
  std::vector<std::string> rows;
  for (const char* opacity : {"1e999", "-1e999", "-1e-999"})
    rows.push_back("0 0 0 0 0 0 1 0 0 " + std::string(opacity) + " -3 -3 -3 1 0 0 0\n");
  const GaussianCloud cloud =
      read_sound(text.substr(0, text.find("end_header\n") + 11) + rows[0] + rows[1] + rows[2]);
  ASSERT_EQ(cloud.count(), 3u);
  EXPECT_EQ(cloud.opacity[0], 1.0f);
  EXPECT_EQ(cloud.opacity[1], 0.0f);
  EXPECT_EQ(cloud.opacity[2], 0.5f);
}

TEST(PlyText, HeadersOfOtherSystems) {
  const std::string text = tests::sample_ply(1, 3);
  const GaussianCloud expected = read_sound(text);
  const size_t body = text.find("end_header\n") + 11;
  std::string dos, mac;
  for (const char c : text.substr(0, body)) {
    dos += c == '\n' ? "\r\n" : std::string(1, c);
    mac += c == '\n' ? '\r' : c;
  }
  for (const std::string& header : {dos, mac, "\xEF\xBB\xBF" + text.substr(0, body)})
    EXPECT_EQ(read_sound(header + text.substr(body)).sh, expected.sh);
  const std::string comments =
      "ply\ncomment\tby   " + std::string(300, '\xC3') + "\n\ncomment\n" + text.substr(4);
  EXPECT_EQ(read_sound(comments).sh, expected.sh);
  EXPECT_TRUE(has_remark(read_sound(text + "more"), "4 bytes behind the last element"));
}

TEST(Describe, SaysAllThatWasTakenForGranted) {
  GaussianCloud cloud = read_sound(tests::sample_ply(1, 2));
  EXPECT_EQ(describe(cloud), "2 Gaussians of degree 1 (ply), up -y (assumed)");
  cloud.up = UpAxis::kPlusZ;
  cloud.antialiased = true;
  cloud.left_out = 3;
  cloud.left_out_why = "Gaussian 0: why";
  cloud.origin_m = {500000, 0, -2};
  cloud.remarks = {"one", "two"};
  EXPECT_EQ(describe(cloud),
            "2 Gaussians of degree 1 (ply), left out 3 (Gaussian 0: why), origin 500000 0 -2, "
            "antialiased, up +z; one; two");
}

}  // namespace
}  // namespace figurine::ports::ply_kinds_test
