#include "tests/stability/scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "tests/oracle/splat_oracle.h"

namespace figurine::stability {
namespace {

[[noreturn]] void stop(const Status& status) {
  std::fprintf(stderr, "stability: %s\n", status.message().c_str());
  std::abort();
}

}  // namespace

void GaussianSet::add(const Vector& position, const std::array<float, 9>& factor,
                      float opacity_value, const Vector& colour) {
  position_m.insert(position_m.end(), position.begin(), position.end());
  covariance_factor.insert(covariance_factor.end(), factor.begin(), factor.end());
  opacity.push_back(opacity_value);
  for (float channel : colour) sh.push_back((channel - kShOffset) / kSh0);
}

void GaussianSet::append(const GaussianSet& other) {
  position_m.insert(position_m.end(), other.position_m.begin(), other.position_m.end());
  covariance_factor.insert(covariance_factor.end(), other.covariance_factor.begin(),
                           other.covariance_factor.end());
  opacity.insert(opacity.end(), other.opacity.begin(), other.opacity.end());
  sh.insert(sh.end(), other.sh.begin(), other.sh.end());
}

double Random::uniform(double low, double high) {
  state_ = state_ * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double(state_ >> 11) * 0x1p-53);
}

std::array<float, 4> Random::quaternion() {
  for (;;) {
    std::array<float, 4> q;
    float length2 = 0;
    for (float& value : q) {
      value = static_cast<float>(uniform(-1, 1));
      length2 += value * value;
    }
    if (length2 > 0.01f && length2 < 1) return q;
  }
}

std::array<float, 9> factor_of(const std::array<float, 4>& wxyz, const Vector& scale_m) {
  std::array<float, 9> factor = rotation_from_quaternion(wxyz.data());
  for (int i = 0; i < 9; ++i) factor[i] *= scale_m[i % 3];
  return factor;
}

GaussianSet make_cloud(const CloudOptions& options) {
  GaussianSet set;
  Random random(options.seed);
  for (uint32_t i = 0; i < options.count; ++i) {
    Vector position, colour;
    for (int k = 0; k < 3; ++k)
      position[k] =
          options.centre_m[k] + static_cast<float>(random.uniform(-1, 1)) * options.half_size_m;
    for (float& channel : colour) channel = static_cast<float>(random.uniform(0, 1));
    const float opacity =
        static_cast<float>(random.uniform(options.opacity_low, options.opacity_high));
    set.add(position, factor_of(random.quaternion(), options.scale_m), opacity, colour);
  }
  return set;
}

Camera front_camera(uint32_t size_px, float distance_m, float vertical_fov_deg) {
  const Result<Camera> camera = make_orbit_camera(
      {.distance_m = distance_m, .vertical_fov_deg = vertical_fov_deg}, size_px, size_px);
  if (!camera.ok()) stop(camera.status());
  return *camera;
}

Picture draw(std::span<const GaussianView> sets, const Camera& camera, uint32_t threads,
             const SplatOptions& splat, const Approximation& approximation) {
  const auto renderer = Renderer::create({.threads = threads, .allow_oversubscription = true});
  if (!renderer.ok()) stop(renderer.status());
  Picture picture;
  picture.rgba.assign(size_t(camera.width_px) * camera.height_px * 4,
                      std::numeric_limits<float>::quiet_NaN());  // every pixel must be written
  const Status status = (*renderer)->render(
      {.camera = camera, .gaussians = sets, .splat = splat, .approximation = approximation},
      {.pixels = picture.rgba.data(),
       .stride_bytes = 4 * sizeof(float) * camera.width_px,
       .format = PixelFormat::kRgbaF32});
  if (!status.ok()) stop(status);
  picture.statistics = (*renderer)->statistics();
  return picture;
}

Picture draw(const GaussianSet& set, const Camera& camera, const SplatOptions& splat) {
  const GaussianView view = set.view();
  return draw({&view, 1}, camera, 1, splat);
}

Agreement compare_with_oracle(const GaussianSet& set, const Camera& camera, bool antialiased) {
  Picture picture = draw(set, camera, {.antialiased = antialiased});
  const oracle::Image truth =
      oracle::render(oracle::from_view(set.view()), camera, {.antialiased = antialiased});
  Agreement agreement;
  agreement.not_finite = count_not_finite(picture.rgba);
  for (size_t pixel = 0; pixel < truth.transmittance.size(); ++pixel) {
    float* rgba = &picture.rgba[4 * pixel];
    for (int c = 0; c < 3; ++c) {
      rgba[c] *= rgba[3];
      agreement.largest = std::max(agreement.largest, std::abs(rgba[c] - truth.rgb[3 * pixel + c]));
    }
    agreement.largest = std::max(agreement.largest, std::abs(rgba[3] - truth.alpha(pixel)));
    if (truth.alpha(pixel) > 0.5) ++agreement.foreground;
  }
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (agreement.not_finite > 0) agreement.largest = kNan;
  const double psnr_db = oracle::foreground_psnr_db<float>(truth, picture.rgba);
  agreement.psnr_db = agreement.foreground < 20 ? kNan : std::min(psnr_db, 200.0);
  return agreement;
}

void add_agreement(Rows& rows, const std::string& name, const GaussianSet& set,
                   const Camera& camera, double at_least_db, double flip) {
  add_agreement(rows, name, compare_with_oracle(set, camera), at_least_db, flip);
}

void add_agreement(Rows& rows, const std::string& name, const Agreement& agreement,
                   double at_least_db, double flip) {
  rows.push_back({name, "foreground psnr_db against the float64 oracle", Bound::kAtLeast,
                  at_least_db, agreement.psnr_db});
  rows.push_back({name, "largest difference of a premultiplied channel from the float64 oracle",
                  Bound::kAtMost, flip, agreement.largest});
}

size_t count_not_finite(std::span<const float> values) {
  return static_cast<size_t>(std::count_if(values.begin(), values.end(),
                                           [](float value) { return !std::isfinite(value); }));
}

size_t count_different(std::span<const float> a, std::span<const float> b) {
  size_t different = a.size() > b.size() ? a.size() - b.size() : b.size() - a.size();
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    different += std::memcmp(&a[i], &b[i], sizeof(float)) != 0;
  return different;
}

}  // namespace figurine::stability
