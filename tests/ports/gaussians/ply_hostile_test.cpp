// Broken and hostile .ply files: one line that names the file and the reason, no crash, no memory
// beyond the file's own size.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "ports/gaussians/ply.h"
#include "ports/gaussians/ply_text.h"

namespace figurine::ports::ply_hostile_test {
namespace {

using tests::PlyColumn;
using tests::PlyEncoding;
using tests::sample_ply;
using tests::sample_value;
using tests::standard_columns;

Result<GaussianCloud> read(const std::string& text) {
  return read_gaussian_ply(std::as_bytes(std::span(text)), "x.ply");
}

void expect_refused(const std::string& text, const std::string& reason,
                    StatusCode code = StatusCode::kCorrupt) {
  const Result<GaussianCloud> cloud = read(text);
  ASSERT_FALSE(cloud.ok()) << reason;
  EXPECT_EQ(cloud.status().code(), code) << cloud.status().message();
  EXPECT_TRUE(cloud.status().message().starts_with("x.ply: ply: ")) << cloud.status().message();
  EXPECT_NE(cloud.status().message().find(reason), std::string::npos) << cloud.status().message();
  EXPECT_EQ(cloud.status().message().find('\n'), std::string::npos) << "one line";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(HostilePly, EveryMissingPropertyIsNamed) {
  for (const PlyColumn& column : standard_columns(1, false)) {
    std::vector<PlyColumn> columns = standard_columns(1, false);
    std::erase_if(columns, [&](const PlyColumn& c) { return c.name == column.name; });
    const std::string text = tests::make_ply(columns, 2, PlyEncoding::kLittle, sample_value);
    if (column.name == "scale_2") continue;  // two scales are a disc
    expect_refused(text, column.name.starts_with("f_rest_") ? "8 f_rest properties"
                                                            : "no property " + column.name);
  }
}

TEST(HostilePly, EveryPrefixIsRefused) {
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kLittle, PlyEncoding::kBig}) {
    const std::string text = sample_ply(1, 3, encoding);
    // The last line's end, and digits of the last number, may go without loss in ascii.
    const size_t end = encoding == PlyEncoding::kAscii ? text.find_last_of(' ') + 1 : text.size();
    for (size_t length = 0; length < end; ++length)
      EXPECT_FALSE(read(text.substr(0, length)).ok()) << length;
    EXPECT_TRUE(read(text).ok());
  }
}

TEST(HostilePly, HugeCountsTakeNoMemory) {
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kLittle}) {
    const std::string text = sample_ply(0, 3, encoding);
    EXPECT_FALSE(read(replaced(text, "vertex 3", "vertex 4")).ok());
    for (const char* count :
         {"4294967295", "4294967296", "18446744073709551615", "1000000000000"}) {
      expect_refused(replaced(text, "vertex 3", std::string("vertex ") + count),
                     "the data holds at most");
    }
    expect_refused(replaced(text, "vertex 3", "vertex 18446744073709551616"), "count");
    expect_refused(replaced(text, "vertex 3", "vertex -1"), "count");
    expect_refused(replaced(text, "vertex 3", "vertex 3.5"), "count");
  }
}

TEST(HostilePly, HugeElementsBeforeTheVertices) {
  const std::string text = sample_ply(0, 3);
  expect_refused(replaced(text, "element vertex",
                          "element a 18446744073709551615\nproperty uchar b\nelement vertex"),
                 "ends early");
  expect_refused(
      replaced(text, "element vertex",
               "element a 18446744073709551615\nproperty list uchar uchar b\nelement vertex"),
      "ends early");
  expect_refused(replaced(text, "element vertex",
                          "element a 1\nproperty list double double b\nelement vertex"),
                 "");
  // An element without properties has no bytes, however many rows it claims.
  EXPECT_TRUE(
      read(replaced(text, "element vertex", "element a 18446744073709551615\nelement vertex"))
          .ok());
}

TEST(HostilePly, BrokenHeaders) {
  const std::string text = sample_ply(0, 2);
  expect_refused("", "does not start with 'ply'");
  expect_refused("plx\n", "does not start with 'ply'");
  expect_refused(std::string(100, '\0'), "does not start with 'ply'");
  expect_refused("ply\nformat ascii 1.0\n", "no end_header");
  expect_refused("ply\nend_header\n", "no format");
  expect_refused("ply\nformat ascii 1.0\nend_header\n", "no element vertex");
  expect_refused(replaced(text, "binary_little_endian", "binary_middle_endian"), "unknown format");
  expect_refused(replaced(text, "property float x", "property half x"), "property type");
  expect_refused(replaced(text, "property float x", "property list uchar float x"),
                 "the property x is a list");
  expect_refused(replaced(text, "property float x", "property list half float x"), "property type");
  expect_refused(replaced(text, "property float x", "property float x y"), "property type");
  expect_refused(replaced(text, "property float x", "nonsense"), "no header line: 'nonsense'");
  expect_refused(replaced(text, "element vertex 2\n", ""), "property before any element");
  expect_refused(
      replaced(text, "comment made by a test", std::string("\x1b[31m\x07") + std::string(100, 'x')),
      "no header line: '?[31m?xxx");
  std::string many = "ply\nformat ascii 1.0\nelement vertex 1\n";
  for (int i = 0; i < 5000; ++i) many += "property float p\n";
  expect_refused(many + "end_header\n", "more than 4096 properties");
  expect_refused("ply\n" + std::string(2 << 20, '\n') + "format ascii 1.0\nend_header\n",
                 "no end_header");
}

TEST(HostilePly, WordsThatAreNoNumbersCostOneGaussian) {
  const std::string text = sample_ply(0, 3, PlyEncoding::kAscii);
  const size_t body = text.find("end_header\n") + 11;
  for (const char* word : {"x ", "1.0e ", "0x10 ", "1,5 ", "-- ", "+-1 ", "++1 "}) {
    const Result<GaussianCloud> cloud =
        read(text.substr(0, body) + word + text.substr(text.find(' ', body) + 1));
    ASSERT_TRUE(cloud.ok()) << cloud.status().message();
    EXPECT_EQ(cloud->count(), 2u) << word;
    EXPECT_EQ(cloud->left_out, 1u) << word;
    EXPECT_EQ(cloud->left_out_why, "Gaussian 0: x is no number") << word;
  }
}

// Without lines to hold on to, one value too many would shift all that follow.
TEST(HostilePly, LinesOfAnotherLengthCostOneGaussian) {
  const std::string text = sample_ply(0, 4, PlyEncoding::kAscii);
  const size_t second = text.find('\n', text.find("end_header\n") + 11) + 1;
  std::string longer = text, shorter = text;
  longer.insert(second, "7 ");
  shorter.erase(second, text.find(' ', second) + 1 - second);
  const Result<GaussianCloud> all = read(text), more = read(longer), less = read(shorter);
  ASSERT_TRUE(all.ok() && more.ok() && less.ok());
  for (const Result<GaussianCloud>* cloud : {&more, &less}) {
    EXPECT_EQ((*cloud)->left_out, 1u);
    ASSERT_EQ((*cloud)->count(), 3u);
    EXPECT_EQ((*cloud)->position_m[3], all->position_m[6]) << "those behind are themselves";
    EXPECT_EQ((*cloud)->opacity[2], all->opacity[3]);
  }
  EXPECT_EQ(more->left_out_why, "Gaussian 1: its line has too many values");
  EXPECT_EQ(less->left_out_why, "Gaussian 1: its line has only 16 values");
  std::string one_line = text;  // allowed, and then nothing can be told apart
  const size_t body = text.find("end_header\n") + 11;
  std::replace(one_line.begin() + static_cast<long>(body), one_line.end(), '\n', ' ');
  EXPECT_EQ(read(one_line)->count(), 4u);
  expect_refused(one_line.replace(second, 0, "7 "), "more values than it declares");
}

TEST(HostilePly, ACutFileSaysHowMuchIsThere) {
  const std::string text = sample_ply(0, 20);
  expect_refused(text.substr(0, text.size() - 5),
                 "declares 20 vertices, the data holds at most 19");
  const std::string ascii = sample_ply(0, 20, PlyEncoding::kAscii);
  expect_refused(ascii.substr(0, ascii.size() - 20), "the data ends in number 19");
}

TEST(HostilePly, AmbiguousNamesAreRefused) {
  const std::string text = sample_ply(0, 2);
  expect_refused(replaced(text, "property float nx", "property float x"), "property x twice");
  expect_refused(replaced(text, "element vertex 2", "element vertex 0\nelement vertex 2"),
                 "two elements are called 'vertex'");
}

// Flipped bytes may give other numbers, never a crash or a cloud that contradicts itself.
TEST(HostilePly, FlippedBytesStaySound) {
  std::mt19937 random(3);
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kLittle}) {
    const std::string text = sample_ply(1, 3, encoding);
    size_t accepted = 0;
    for (int round = 0; round < 20000; ++round) {
      std::string broken = text;
      for (unsigned flips = 1 + random() % 3; flips > 0; --flips)
        broken[random() % broken.size()] ^= static_cast<char>(1u << random() % 8);
      const Result<GaussianCloud> cloud = read(broken);
      if (!cloud.ok()) continue;
      ++accepted;
      ASSERT_LE(cloud->count() + cloud->left_out, text.size());
      ASSERT_EQ(cloud->position_m.size(), 3 * size_t(cloud->count()));
      ASSERT_EQ(cloud->covariance_factor.size(), 9 * size_t(cloud->count()));
      ASSERT_EQ(cloud->sh.size(), 3 * size_t(sh_coefficients(cloud->sh_degree)) * cloud->count());
      for (const float value : cloud->opacity) ASSERT_TRUE(value >= 0 && value <= 1);
    }
    EXPECT_GT(accepted, 100u);
  }
}

}  // namespace
}  // namespace figurine::ports::ply_hostile_test
