// Sets of Gaussians, and the two renderers that are held against each other: the device's in float,
// the brute-force oracle in double.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "tests/stability/rows.h"

namespace figurine::stability {

using Vector = std::array<float, 3>;

struct GaussianSet {
  uint32_t sh_degree = 0;
  std::vector<float> position_m, covariance_factor, opacity, sh;

  uint32_t count() const { return static_cast<uint32_t>(opacity.size()); }
  GaussianView view() const {
    return {count(), sh_degree, position_m, covariance_factor, opacity, sh};
  }
  void add(const Vector& position, const std::array<float, 9>& factor, float opacity,
           const Vector& colour);  // degree 0
  void append(const GaussianSet& other);
};

// Uniform numbers that are the same on every machine.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 1) {}
  double uniform(double low, double high);
  std::array<float, 4> quaternion();  // any direction, not normalised

 private:
  uint64_t state_;
};

// R diag(scale) of the rotation of a quaternion.
std::array<float, 9> factor_of(const std::array<float, 4>& wxyz, const Vector& scale_m);

struct CloudOptions {
  uint32_t count = 2000;
  Vector centre_m{0, 0, 0};
  float half_size_m = 0.8f;
  Vector scale_m{0.02f, 0.02f, 0.006f};  // of every Gaussian, in its own random orientation
  double opacity_low = 0.3, opacity_high = 0.95;
  uint64_t seed = 1;
};
GaussianSet make_cloud(const CloudOptions& options);

// At distance_m in front of the origin, looking at it.
Camera front_camera(uint32_t size_px = 256, float distance_m = 3, float vertical_fov_deg = 40);

struct Picture {
  std::vector<float> rgba;  // [h,w,4] straight colour
  FrameStatistics statistics;
};
Picture draw(std::span<const GaussianView> sets, const Camera& camera, uint32_t threads = 1,
             const SplatOptions& splat = {}, const Approximation& approximation = {});
Picture draw(const GaussianSet& set, const Camera& camera, const SplatOptions& splat = {});

struct Agreement {
  double psnr_db = 0;  // over pixels whose true alpha exceeds 0.5, over mid-grey; at most 200, NaN
                       // if there are fewer than 20 such pixels
  double largest =
      0;  // premultiplied colours and alpha, over all pixels; NaN if anything is not finite
  size_t foreground = 0;  // pixels
  size_t not_finite = 0;  // values
};
Agreement compare_with_oracle(const GaussianSet& set, const Camera& camera,
                              bool antialiased = false);

// The two usual rows of a scene. flip: what one contribution at the cut, or one at the stop of an
// opaque pixel, may change.
void add_agreement(Rows& rows, const std::string& name, const GaussianSet& set,
                   const Camera& camera, double at_least_db, double flip);
void add_agreement(Rows& rows, const std::string& name, const Agreement& agreement,
                   double at_least_db, double flip);

size_t count_not_finite(std::span<const float> values);
size_t count_different(std::span<const float> a, std::span<const float> b);  // bitwise

}  // namespace figurine::stability
