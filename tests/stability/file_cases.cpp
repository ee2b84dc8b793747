// Scenes far from the origin, as files have them: where floats are a metre apart, what was stored
// in doubles, and what was stored in floats, is drawn as it would be at the origin.
#include <algorithm>
#include <cmath>
#include <string>

#include "ports/gaussians/gaussian_file.h"
#include "ports/gaussians/ply.h"
#include "tests/stability/scene.h"

namespace figurine::stability {
namespace file {
namespace {

constexpr double kCutFlip = 0.0045;  // as in splat_cases.cpp

using Origin = std::array<double, 3>;

struct Moved {
  GaussianSet set;     // as it was read, its origin taken back to a camera's coordinates
  double error_m = 0;  // largest, of a position in the file's coordinates
};

// Through a .ply with its middle at `origin`, and back by the reader that programs use.
Moved through_a_file(const GaussianSet& set, const Origin& origin) {
  const Result<ports::GaussianCloud> cloud = ports::read_gaussians(
      ports::write_gaussian_ply(set.view(), {.comments = {}, .origin_m = origin}), "far.ply");
  Moved moved;
  if (!cloud.ok() || cloud->count() != set.count()) {
    moved.error_m = NAN;
    return moved;
  }
  moved.set = {cloud->sh_degree, cloud->position_m, cloud->covariance_factor, cloud->opacity,
               cloud->sh};
  for (size_t i = 0; i < set.position_m.size(); ++i) {
    // A camera moves with the scene: by whole numbers, which is exact.
    const double back = cloud->origin_m[i % 3] - origin[i % 3];
    moved.error_m =
        std::max(moved.error_m, std::abs(cloud->position_m[i] + back - double(set.position_m[i])));
    moved.set.position_m[i] = static_cast<float>(cloud->position_m[i] + back);
  }
  return moved;
}

// The closed form: a double near 10^7 is at most 2^-30 m from what was meant, and a float below 2,
// which is what a position is once the origin is subtracted, 2^-24 m.
Rows doubles_at_the_ends_of_the_earth() {
  Rows rows;
  const GaussianSet set = make_cloud({});
  for (const Origin& origin : {Origin{1e7, -1e7, 1e7}, Origin{4649776.25, 5.5, -321000.75}}) {
    const std::string name = "a .ply of doubles about (" + std::to_string(int64_t(origin[0])) +
                             ", " + std::to_string(int64_t(origin[1])) + ", " +
                             std::to_string(int64_t(origin[2])) + ") m";
    const Moved moved = through_a_file(set, origin);
    rows.push_back({name, "largest error of a position [m]; 2^-30 + 2^-24 = 6.1e-8", Bound::kAtMost,
                    0x1p-30 + 0x1p-24, moved.error_m});
    add_agreement(rows, name, moved.set, front_camera(), 105, kCutFlip);
  }
  return rows;
}

// Floats near 10^7 m are 1 m apart: nothing brings back what they lost, and nothing may be lost on
// top of it.
Rows floats_at_the_ends_of_the_earth() {
  GaussianSet set = make_cloud({.half_size_m = 40, .scale_m = {1, 1, 0.3f}});
  const float middle = 1e7f;
  GaussianSet stored = set;
  for (float& value : stored.position_m) value += middle;
  const Result<ports::GaussianCloud> cloud =
      ports::read_gaussians(ports::write_gaussian_ply(stored.view()), "far.ply");
  double error_m = cloud.ok() && cloud->count() == set.count() ? 0 : NAN;
  for (size_t i = 0; error_m == error_m && i < stored.position_m.size(); ++i) {
    const double read = cloud->position_m[i] + cloud->origin_m[i % 3];
    error_m = std::max(error_m, std::abs(read - double(stored.position_m[i])));
  }
  Rows rows{{"a .ply of floats about 10^7 m", "largest change of a position [m]", Bound::kAtMost, 0,
             error_m}};
  if (!cloud.ok()) return rows;
  const GaussianSet read{cloud->sh_degree, cloud->position_m, cloud->covariance_factor,
                         cloud->opacity, cloud->sh};
  add_agreement(rows, "a .ply of floats about 10^7 m", read, front_camera(256, 150), 105, kCutFlip);
  return rows;
}

}  // namespace
}  // namespace file

std::span<const Case> file_cases() {
  static const Case kCases[] = {{"DoublesFarFromTheOrigin", file::doubles_at_the_ends_of_the_earth},
                                {"FloatsFarFromTheOrigin", file::floats_at_the_ends_of_the_earth}};
  return kCases;
}

}  // namespace figurine::stability
