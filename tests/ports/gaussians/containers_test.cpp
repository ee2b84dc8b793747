// Compressed .ply and .splat: every bit of a record against values worked out here, and every way
// in which such a file can contradict itself.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "ports/gaussians/gaussian_file.h"
#include "ports/gaussians/ply.h"
#include "ports/gaussians/splat.h"

namespace figurine::ports::containers_test {
namespace {

Result<GaussianCloud> read(const std::string& bytes, const std::string& name = "x.ply") {
  return read_gaussians(std::as_bytes(std::span(bytes)), name);
}

void expect_refused(const std::string& bytes, const std::string& name, const std::string& reason,
                    StatusCode code = StatusCode::kCorrupt) {
  const Result<GaussianCloud> cloud = read(bytes, name);
  ASSERT_FALSE(cloud.ok()) << reason;
  EXPECT_EQ(cloud.status().code(), code) << cloud.status().message();
  EXPECT_TRUE(cloud.status().message().starts_with(name + ": ")) << cloud.status().message();
  EXPECT_NE(cloud.status().message().find(reason), std::string::npos) << cloud.status().message();
  EXPECT_EQ(cloud.status().message().find('\n'), std::string::npos) << "one line";
}

template <class T>
void add(std::string& bytes, T value, bool big = false) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (big) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

struct Packed {
  uint32_t position = 0, rotation = 0, scale = 0, colour = 0;
};

struct Compressed {
  std::vector<std::array<float, 18>> chunks;
  std::vector<Packed> vertices;
  std::vector<uint8_t> sh;  // sh_values a vertex
  size_t sh_values = 0;
  bool colour_ranges = true, big = false;
  std::string comment;

  std::string bytes() const {
    constexpr const char* kChunk[] = {
        "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
        "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
        "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};
    std::string text = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                       "_endian 1.0\n" + comment + "element chunk " +
                       std::to_string(chunks.size()) + "\n";
    const size_t ranges = colour_ranges ? 18 : 12;
    for (size_t k = 0; k < ranges; ++k) text += std::string("property float ") + kChunk[k] + "\n";
    text += "element vertex " + std::to_string(vertices.size()) +
            "\nproperty uint packed_position\nproperty uint packed_rotation\n"
            "property uint packed_scale\nproperty uint packed_color\n";
    if (sh_values > 0) text += "element sh " + std::to_string(vertices.size()) + "\n";
    for (size_t k = 0; k < sh_values; ++k)
      text += "property uchar f_rest_" + std::to_string(k) + "\n";
    text += "end_header\n";
    for (const auto& chunk : chunks) {
      for (size_t k = 0; k < ranges; ++k) add(text, chunk[k], big);
    }
    for (const Packed& vertex : vertices) {
      for (const uint32_t word : {vertex.position, vertex.rotation, vertex.scale, vertex.colour})
        add(text, word, big);
    }
    for (const uint8_t byte : sh) add(text, byte);
    return text;
  }
};

constexpr std::array<float, 18> kChunk{-1, -2, -3, 1, 2,    3, -5, -6,   -7,
                                       -1, -2, -3, 0, 0.1f, 0, 1,  0.9f, 2};

// 11, 10 and 11 bits; all ones are the upper ends.
TEST(CompressedPly, UnpacksEveryBit) {
  Compressed file{.chunks = {kChunk},
                  .vertices = {{.position = 0, .rotation = 0x1FF7FDFFu, .scale = 0, .colour = 0},
                               {.position = ~0u, .scale = ~0u, .colour = ~0u},
                               {.position = 1023u << 21 | 511u << 11 | 1023u,
                                .scale = 1u << 21 | 1u << 11 | 1u,
                                .colour = 51u << 24 | 102u << 16 | 153u << 8 | 204u}}};
  for (const bool big : {false, true}) {
    file.big = big;
    const Result<GaussianCloud> cloud = read(file.bytes());
    ASSERT_TRUE(cloud.ok()) << cloud.status().message();
    ASSERT_EQ(cloud->count(), 3u);
    EXPECT_EQ(cloud->container, "compressed ply");
    EXPECT_EQ(std::vector<float>(cloud->position_m.begin(), cloud->position_m.begin() + 6),
              (std::vector<float>{-1, -2, -3, 1, 2, 3}));
    EXPECT_NEAR(cloud->position_m[6], -1 + 2 * 1023.0 / 2047, 1e-6);
    EXPECT_NEAR(cloud->position_m[7], -2 + 4 * 511.0 / 1023, 1e-6);
    EXPECT_NEAR(cloud->position_m[8], -3 + 6 * 1023.0 / 2047, 1e-6);
    EXPECT_EQ(cloud->opacity[0], 0.0f);
    EXPECT_EQ(cloud->opacity[1], 1.0f);
    EXPECT_NEAR(cloud->opacity[2], 0.8, 1e-6);
    const float* sh = &cloud->sh[6];
    EXPECT_NEAR(sh[0] * kSh0 + kShOffset, 0.2, 1e-6);
    EXPECT_NEAR(sh[1] * kSh0 + kShOffset, 0.1 + 0.8 * 0.4, 1e-6);
    EXPECT_NEAR(sh[2] * kSh0 + kShOffset, 2 * 0.6, 1e-6);
  }
}

// Two bits name the component that is left out, the others follow in their order: wxyz.
TEST(CompressedPly, RotationsOfEveryLargestComponent) {
  const double half = std::sqrt(2.0) * (767 / 1023.0 - 0.5);  // of 767: about 0.353
  for (uint32_t largest = 0; largest < 4; ++largest) {
    const uint32_t packed = largest << 30 | 767u << 20 | 512u << 10 | 512u;
    const Result<GaussianCloud> cloud =
        read(Compressed{.chunks = {kChunk}, .vertices = {{.rotation = packed}}}.bytes());
    ASSERT_TRUE(cloud.ok());
    const double middle = std::sqrt(2.0) * (512 / 1023.0 - 0.5);
    std::array<double, 4> q{};
    for (size_t i = 0, at = 0; i < 4; ++i) {
      if (i != largest) q[i] = at++ == 0 ? half : middle;
    }
    q[largest] = std::sqrt(1 - half * half - 2 * middle * middle);
    const double first_column[3] = {1 - 2 * (q[2] * q[2] + q[3] * q[3]),
                                    2 * (q[1] * q[2] + q[0] * q[3]),
                                    2 * (q[1] * q[3] - q[0] * q[2])};
    for (size_t r = 0; r < 3; ++r)
      EXPECT_NEAR(cloud->covariance_factor[3 * r], first_column[r] * std::exp(-5), 1e-8) << largest;
  }
}

TEST(CompressedPly, HarmonicsAreStepsOfAnEighthWithTrueEnds) {
  Compressed file{
      .chunks = {kChunk}, .vertices = {{}}, .sh = {0, 255, 128, 1, 2, 3, 4, 5, 6}, .sh_values = 9};
  const Result<GaussianCloud> cloud = read(file.bytes());
  ASSERT_TRUE(cloud.ok()) << cloud.status().message();
  EXPECT_EQ(cloud->sh_degree, 1u);
  const float expected[3] = {-4, 4, 8 * (128.5f / 256 - 0.5f)};  // the reds of the three bands
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(cloud->sh[3 * (k + 1)], expected[k], 1e-6);
  EXPECT_NEAR(cloud->sh[3 + 1], 8 * (1.5 / 256 - 0.5), 1e-6) << "the first green";
}

TEST(CompressedPly, OldFilesHaveNoRangesOfColours) {
  Compressed file{
      .chunks = {kChunk}, .vertices = {{.colour = 51u << 24 | 255u}}, .colour_ranges = false};
  const Result<GaussianCloud> cloud = read(file.bytes());
  ASSERT_TRUE(cloud.ok()) << cloud.status().message();
  EXPECT_NEAR(cloud->sh[0] * kSh0 + kShOffset, 0.2, 1e-6);
  EXPECT_NEAR(cloud->sh[1] * kSh0 + kShOffset, 0, 1e-6);
}

TEST(CompressedPly, ChunksOf256) {
  std::array<float, 18> second = kChunk;
  second[0] = second[3] = 40;
  Compressed file{.chunks = {kChunk, second}, .vertices = std::vector<Packed>(300)};
  const Result<GaussianCloud> cloud = read(file.bytes());
  ASSERT_TRUE(cloud.ok());
  EXPECT_EQ(cloud->position_m[3 * 255], -1.0f);
  EXPECT_EQ(cloud->position_m[3 * 256], 40.0f);
  file.chunks.pop_back();
  expect_refused(file.bytes(), "x.ply", "1 chunks of 256 for 300 vertices");
}

TEST(CompressedPly, ABrokenChunkCostsItsGaussians) {
  std::array<float, 18> broken = kChunk;
  broken[9] = std::numeric_limits<float>::quiet_NaN();
  const Compressed file{.chunks = {broken, kChunk}, .vertices = std::vector<Packed>(300)};
  const Result<GaussianCloud> cloud = read(file.bytes());
  ASSERT_TRUE(cloud.ok());
  EXPECT_EQ(cloud->count(), 44u);
  EXPECT_EQ(cloud->left_out, 256u);
}

TEST(CompressedPly, CommentsHoldAsInPlainOnes) {
  Compressed file{.chunks = {kChunk}, .vertices = {{}}};
  file.comment = "comment SplatRenderMode: mip\ncomment Vertical axis: z\n";
  const Result<GaussianCloud> mip = read(file.bytes());
  ASSERT_TRUE(mip.ok());
  EXPECT_TRUE(mip->antialiased);
  EXPECT_EQ(mip->up, UpAxis::kPlusZ);
  file.comment = "comment SplatRenderMode: 2dgs\n";
  const Result<GaussianCloud> flat = read(file.bytes());
  ASSERT_TRUE(flat.ok());
  for (size_t r = 0; r < 3; ++r) EXPECT_EQ(flat->covariance_factor[3 * r + 2], 0);
}

TEST(CompressedPly, ContradictionsAreNamed) {
  const Compressed file{
      .chunks = {kChunk}, .vertices = {{}, {}}, .sh = std::vector<uint8_t>(18), .sh_values = 9};
  const std::string text = file.bytes();
  expect_refused(replaced(text, "float max_scale_z", "float max_scale_w"), "x.ply",
                 "element chunk has no property max_scale_z");
  expect_refused(replaced(text, "float max_b", "float max_q"), "x.ply", "max_b");
  expect_refused(replaced(text, "float min_x", "double min_x"), "x.ply", "min_x has another type");
  expect_refused(replaced(text, "packed_color", "packed_colour"), "x.ply", "packed_color");
  expect_refused(replaced(text, "element chunk", "element chunks"), "x.ply", "no element chunk");
  expect_refused(replaced(text, "element sh 2", "element sh 1"), "x.ply", "element sh has 1 rows");
  expect_refused(replaced(text, "uchar f_rest_3", "uint f_rest_3"), "x.ply", "uchar f_rest_3");
  expect_refused(replaced(text, "uchar f_rest_3", "uchar f_rest_9"), "x.ply", "uchar f_rest_3");
  expect_refused(replaced(text, "binary_little_endian", "ascii"), "x.ply", "in ascii",
                 StatusCode::kUnsupported);
  expect_refused(replaced(text, "property uint packed_color\n",
                          "property uint packed_color\nproperty list uchar int more\n"),
                 "x.ply", "has a list", StatusCode::kUnsupported);
  for (const char* count : {"3", "257", "2147483648", "4294967296", "18446744073709551615"}) {
    const std::string more = replaced(replaced(text, "vertex 2", std::string("vertex ") + count),
                                      "element sh 2", std::string("element sh ") + count);
    EXPECT_FALSE(read(more).ok()) << count;
  }
  expect_refused(replaced(text, "element chunk 1", "element chunk 4000000000"), "x.ply",
                 "the data holds at most");
  for (size_t length = 0; length < text.size(); ++length)
    EXPECT_FALSE(read(text.substr(0, length)).ok()) << length;
}

TEST(CompressedPly, NoGaussiansAtAll) {
  expect_refused(Compressed{}.bytes(), "x.ply", "holds no Gaussian that can be drawn");
}

struct SplatRecord {
  float position[3] = {1, 2, 3}, scale[3] = {0.5f, 0.25f, 0.125f};
  uint8_t colour[4] = {255, 0, 51, 204}, rotation[4] = {255, 128, 128, 128};
};
static_assert(sizeof(SplatRecord) == 32);

std::string splat_bytes(const std::vector<SplatRecord>& records) {
  return {reinterpret_cast<const char*>(records.data()), records.size() * sizeof(SplatRecord)};
}

TEST(Splat, ReadsEveryByte) {
  std::vector<SplatRecord> records(2);
  records[1].rotation[0] = 128;  // half a turn about z
  records[1].rotation[3] = 0;
  const Result<GaussianCloud> cloud = read(splat_bytes(records), "X.SPLAT");
  ASSERT_TRUE(cloud.ok()) << cloud.status().message();
  ASSERT_EQ(cloud->count(), 2u);
  EXPECT_EQ(cloud->container, "splat");
  EXPECT_EQ(cloud->sh_degree, 0u);
  EXPECT_EQ(std::vector<float>(cloud->position_m.begin(), cloud->position_m.begin() + 3),
            (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(
      std::vector<float>(cloud->covariance_factor.begin(), cloud->covariance_factor.begin() + 9),
      (std::vector<float>{0.5f, 0, 0, 0, 0.25f, 0, 0, 0, 0.125f}));
  EXPECT_EQ(
      std::vector<float>(cloud->covariance_factor.begin() + 9, cloud->covariance_factor.end()),
      (std::vector<float>{-0.5f, 0, 0, 0, -0.25f, 0, 0, 0, 0.125f}));
  EXPECT_NEAR(cloud->opacity[0], 0.8, 1e-6);
  EXPECT_NEAR(cloud->sh[0] * kSh0 + kShOffset, 1, 1e-6);
  EXPECT_NEAR(cloud->sh[2] * kSh0 + kShOffset, 0.2, 1e-6);
  EXPECT_EQ(cloud->up, std::nullopt);
}

TEST(Splat, BadNumbersCostOneGaussian) {
  std::vector<SplatRecord> records(5);
  records[0].position[1] = std::numeric_limits<float>::quiet_NaN();
  records[1].scale[0] = -1;
  records[2].scale[2] = std::numeric_limits<float>::infinity();
  records[3].rotation[0] = 128;  // none
  const Result<GaussianCloud> cloud = read(splat_bytes(records), "x.splat");
  ASSERT_TRUE(cloud.ok());
  EXPECT_EQ(cloud->count(), 2u);
  EXPECT_EQ(cloud->left_out, 3u);
  ASSERT_EQ(cloud->remarks.size(), 1u);
  EXPECT_NE(cloud->remarks[0].find("1 without a rotation"), std::string::npos);
}

TEST(Splat, WhatIsNoneIsRefused) {
  const std::string text = splat_bytes(std::vector<SplatRecord>(3));
  for (size_t length = 1; length < text.size(); ++length) {
    if (length % 32 != 0) expect_refused(text.substr(0, length), "x.splat", "no multiple of 32");
  }
  expect_refused(std::string(64, '\xFF'), "x.splat", "no record is a Gaussian");
  expect_refused("", "x.splat", "holds no Gaussian");
  expect_refused(text, "x.ksplat", "no file of Gaussians that is read", StatusCode::kUnsupported);
  expect_refused(std::string(64, 'x'), "x.ply", "does not start with 'ply'");
}

TEST(Containers, FlippedBytesStaySound) {
  std::mt19937 random(5);
  const Compressed compressed{
      .chunks = {kChunk}, .vertices = {{}, {}}, .sh = std::vector<uint8_t>(18), .sh_values = 9};
  const std::pair<std::string, std::string> files[] = {
      {compressed.bytes(), "x.ply"}, {splat_bytes(std::vector<SplatRecord>(3)), "x.splat"}};
  for (const auto& [bytes, name] : files) {
    size_t accepted = 0;
    for (int round = 0; round < 10000; ++round) {
      std::string broken = bytes;
      for (unsigned flips = 1 + random() % 3; flips > 0; --flips)
        broken[random() % broken.size()] ^= static_cast<char>(1u << random() % 8);
      const Result<GaussianCloud> cloud = read(broken, name);
      if (!cloud.ok()) continue;
      ++accepted;
      ASSERT_EQ(cloud->position_m.size(), 3 * size_t(cloud->count()));
      ASSERT_EQ(cloud->sh.size(), 3 * size_t(sh_coefficients(cloud->sh_degree)) * cloud->count());
      for (const float value : cloud->covariance_factor) ASSERT_TRUE(std::isfinite(value));
    }
    EXPECT_GT(accepted, 100u) << name;
  }
}

}  // namespace
}  // namespace figurine::ports::containers_test
