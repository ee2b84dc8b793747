// Every container against splat-transform, an independent reader: tests/data/gaussians has the
// files and what it reads of them.
#include "ports/gaussians/gaussian_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "largest_error.h"
#include "ports/host/files.h"

namespace figurine::ports::gaussian_file_test {
namespace {

GaussianCloud read(const std::string& name) {
  const std::string path = std::string(FIGURINE_SOURCE_DIR "/tests/data/") + name;
  const Result<MappedFile> file = MappedFile::open(path);
  EXPECT_TRUE(file.ok()) << file.status().message();
  if (!file.ok()) return {};
  Result<GaussianCloud> cloud = read_gaussians(file->bytes(), path);
  EXPECT_TRUE(cloud.ok()) << cloud.status().message();
  return cloud.ok() ? std::move(cloud).value() : GaussianCloud{};
}

// F F^T, free of the order and sign of axes.
double covariance(const GaussianCloud& cloud, size_t i, size_t r, size_t c) {
  double sum = 0;
  for (size_t k = 0; k < 3; ++k)
    sum += double(cloud.covariance_factor[9 * i + 3 * r + k]) *
           cloud.covariance_factor[9 * i + 3 * c + k];
  return sum;
}

struct Bounds {
  double position, colour, opacity, covariance;
};

void expect_same(const std::string& name, const std::string& as_read, const Bounds& bounds) {
  SCOPED_TRACE(name);
  const GaussianCloud ours = read(name), theirs = read(as_read);
  ASSERT_EQ(ours.count(), 260u);
  ASSERT_EQ(theirs.count(), 260u);
  ASSERT_EQ(ours.sh_degree, theirs.sh_degree);
  EXPECT_EQ(ours.left_out, 0u);
  EXPECT_TRUE(ours.remarks.empty());
  LargestError position("position"), colour("colour"), opacity("opacity"),
      shape("covariance, relative to its largest entry");
  for (size_t i = 0; i < ours.position_m.size(); ++i)
    position.add(ours.position_m[i], theirs.position_m[i]);
  for (size_t i = 0; i < ours.sh.size(); ++i) colour.add(ours.sh[i], theirs.sh[i]);
  for (size_t i = 0; i < 260; ++i) {
    opacity.add(ours.opacity[i], theirs.opacity[i]);
    double largest = 0;
    for (size_t k = 0; k < 3; ++k) largest = std::max(largest, covariance(theirs, i, k, k));
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 3; ++c)
        shape.add(covariance(ours, i, r, c) / largest, covariance(theirs, i, r, c) / largest);
    }
  }
  EXPECT_LE(position.largest(), bounds.position);
  EXPECT_LE(colour.largest(), bounds.colour);
  EXPECT_LE(opacity.largest(), bounds.opacity);
  EXPECT_LE(shape.largest(), bounds.covariance);
}

// Steps of a float: of coordinates near 1, of logarithms near 10, of logits that are kept 10^-6
// from 0 and 1.
constexpr Bounds kRounding{.position = 5e-7, .colour = 2e-6, .opacity = 2e-6, .covariance = 2e-5};

TEST(AgainstSplatTransform, CompressedPly) {
  expect_same("gaussians/scene.compressed.ply", "gaussians/scene.compressed.ply.as_read.ply",
              kRounding);
}

TEST(AgainstSplatTransform, SpzByGzipAndByZstd) {
  expect_same("gaussians/scene.v3.spz", "gaussians/scene.v3.spz.as_read.ply", kRounding);
  expect_same("gaussians/scene.v4.spz", "gaussians/scene.v3.spz.as_read.ply", kRounding);
}

// It takes the bytes of a rotation as steps of 2/255 from -1, we as the layout's first writer and
// viewer do: (byte - 128) / 128. Half a step apart, which is seen in the covariance alone.
TEST(AgainstSplatTransform, Splat) {
  Bounds bounds = kRounding;
  bounds.covariance = 0.03;
  expect_same("gaussians/scene.splat", "gaussians/scene.splat.as_read.ply", bounds);
}

TEST(GaussianFile, IsKnownByItsBytesOrElseItsName) {
  EXPECT_EQ(read("gaussians/scene.ply").container, "ply");
  EXPECT_EQ(read("gaussians/scene.compressed.ply").container, "compressed ply");
  EXPECT_EQ(read("gaussians/scene.v3.spz").container, "spz 3");
  EXPECT_EQ(read("gaussians/scene.v4.spz").container, "spz 4");
  EXPECT_EQ(read("gaussians/scene.splat").container, "splat");
  for (const char* name : {"a.ply", "b.PLY", "c.splat", "d.Spz"})
    EXPECT_TRUE(is_gaussian_name(name)) << name;
  for (const char* name : {"a.fgn", "ply", "x.ply#1", "x.ksplat", ""})
    EXPECT_FALSE(is_gaussian_name(name)) << name;
}

}  // namespace
}  // namespace figurine::ports::gaussian_file_test
