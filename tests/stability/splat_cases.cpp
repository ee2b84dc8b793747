// The splatter where it is easiest to break: degenerate covariances, the near plane, extreme sizes,
// opacities, distances and lenses, denormals, numbers that are none. Each scene is drawn by the
// device's renderer and, where a reference is meaningful, by the float64 oracle with the same cuts
// and order.
#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/emulated.h"
#include "tests/stability/scene.h"

namespace figurine::stability {
namespace splat {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kDenormal = std::numeric_limits<float>::denorm_min();

// One contribution at the cut: 1/255 of a colour up to 1, with a little room for a second one far
// behind.
constexpr double kCutFlip = 0.0045;
// One contribution at the stop of a nearly opaque pixel: T alpha with T just above 1e-4 / (1 -
// 0.99).
constexpr double kStopFlip = 0.0102;

// What the inner loops rely on for speed must not decide the picture.
double visible_share(const Picture& picture) {
  return double(picture.statistics.visible) / double(picture.statistics.gaussians);
}

size_t drawn_pixels(const Picture& picture) {
  size_t drawn = 0;
  for (size_t i = 3; i < picture.rgba.size(); i += 4) drawn += picture.rgba[i] != 0;
  return drawn;
}

Rows near_singular() {
  Rows rows;
  const Camera camera = front_camera();
  add_agreement(rows, "discs of thickness 1e-7 m", make_cloud({.scale_m = {0.02f, 0.02f, 1e-7f}}),
                camera, 105, kCutFlip);
  add_agreement(rows, "discs of thickness 0", make_cloud({.scale_m = {0.02f, 0.02f, 0}}), camera,
                105, kCutFlip);
  add_agreement(rows, "lines of thickness 0", make_cloud({.scale_m = {0.05f, 0, 0}}), camera, 105,
                kCutFlip);
  add_agreement(rows, "points of extent 0",
                make_cloud({.count = 20000, .half_size_m = 0.4f, .scale_m = {0, 0, 0}}), camera,
                105, kCutFlip);
  return rows;
}

Rows needles() {
  Rows rows;
  const Camera camera = front_camera();
  add_agreement(rows, "needles of 0.5 m by 5 um", make_cloud({.scale_m = {0.5f, 5e-6f, 5e-6f}}),
                camera, 90, kStopFlip);
  // 600 px long and dilated to 0.55 px: alpha changes by 1 within a pixel while the mean lies up to
  // 1,000 px away.
  add_agreement(rows, "needles of 5 m by 5 nm",
                make_cloud({.count = 500, .scale_m = {5, 5e-9f, 5e-9f}}), camera, 90, kStopFlip);
  return rows;
}

Rows near_plane() {
  Rows rows;
  Camera camera = front_camera(256, 1);
  GaussianSet set, behind;
  Random random(2);
  for (int i = 0; i < 200;
       ++i) {  // on the near plane to the last bit, and up to a millimetre around it
    const float off = static_cast<float>(random.uniform(-1, 1)) * (i % 4 == 0   ? 0
                                                                   : i % 4 == 1 ? 1e-7f
                                                                                : 1e-3f);
    const Vector position{static_cast<float>(random.uniform(-0.05, 0.05)),
                          static_cast<float>(random.uniform(-0.05, 0.05)), 0.8f + off};
    set.add(position, factor_of(random.quaternion(), {0.003f, 0.002f, 0.001f}), 0.5f,
            {0.2f, 0.5f, 0.9f});
    behind.add({position[0], position[1], 0.8001f},
               factor_of(random.quaternion(), {0.003f, 0.002f, 0.001f}), 0.5f, {1, 0, 0});
  }
  add_agreement(rows, "Gaussians on the near plane of 0.2 m", set, camera, 105, kCutFlip);
  rows.push_back({"Gaussians 0.1 mm before the near plane", "pixels drawn", Bound::kAtMost, 0,
                  double(drawn_pixels(draw(behind, camera)))});
  camera.near_m = 0.001f;
  GaussianSet close;
  for (int i = 0; i < 300; ++i) {
    const float depth = static_cast<float>(random.uniform(0.0010001, 0.02));
    const float aside = 0.3f * depth;
    close.add({static_cast<float>(random.uniform(-aside, aside)),
               static_cast<float>(random.uniform(-aside, aside)), 1 - depth},
              factor_of(random.quaternion(), {0.0005f, 0.0005f, 0.0002f}), 0.4f,
              {0.9f, 0.5f, 0.1f});
  }
  add_agreement(rows, "Gaussians 1 to 20 mm before the camera, near plane at 1 mm", close, camera,
                105, kStopFlip);
  return rows;
}

Rows behind_the_camera() {
  GaussianSet set = make_cloud({.centre_m = {0, 0, 5}, .scale_m = {0.5f, 0.5f, 0.5f}});
  for (float depth : {0.0f, 1e-30f, -1e-30f, -1e30f})
    set.add({0, 0, 3 - depth}, factor_of({1, 0, 0, 0}, {1, 1, 1}), 1, {1, 1, 1});
  const Picture picture = draw(set, front_camera());
  return {{"Gaussians behind the camera and in its plane", "pixels drawn", Bound::kAtMost, 0,
           double(drawn_pixels(picture))},
          {"Gaussians behind the camera and in its plane", "Gaussians left after culling",
           Bound::kAtMost, 0, double(picture.statistics.visible)}};
}

Rows below_a_pixel() {
  Rows rows;
  add_agreement(rows, "Gaussians of 1 um at 3 m (a pixel is 8.5 mm)",
                make_cloud({.count = 20000, .half_size_m = 0.4f, .scale_m = {1e-6f, 1e-6f, 1e-6f}}),
                front_camera(), 105, kCutFlip);
  // A Gaussian that the 0.3 px^2 dilation has made wide enough for the pixel grid weighs the same
  // wherever it falls between pixel centres.
  double least = kInfinity, most = 0;
  for (int step = 0; step < 64; ++step) {
    GaussianSet one;
    const float pixel_m = 3 / front_camera(64).fx_px;
    one.add({(float(step % 8) / 8) * pixel_m, (float(step / 8) / 8) * pixel_m, 0},
            factor_of({1, 0, 0, 0}, {1e-6f, 1e-6f, 1e-6f}), 0.9f, {1, 1, 1});
    const Picture picture = draw(one, front_camera(64));
    double weight = 0;
    for (size_t i = 3; i < picture.rgba.size(); i += 4) weight += picture.rgba[i];
    least = std::min(least, weight);
    most = std::max(most, weight);
  }
  rows.push_back({"a Gaussian of 1 um moving through a pixel",
                  "relative change of its summed alpha", Bound::kAtMost, 0.03,
                  (most - least) / most});
  return rows;
}

Rows above_the_screen() {
  Rows rows;
  const Camera camera = front_camera();
  add_agreement(
      rows, "Gaussians of 100 m before the camera",
      make_cloud({.count = 50, .scale_m = {100, 80, 60}, .opacity_low = 0.02, .opacity_high = 0.2}),
      camera, 105, kCutFlip);
  add_agreement(
      rows, "Gaussians of 1,000 km",
      make_cloud(
          {.count = 50, .scale_m = {1e6f, 1e6f, 1e6f}, .opacity_low = 0.02, .opacity_high = 0.2}),
      camera, 105, kCutFlip);
  GaussianSet cloud = make_cloud({});
  const Picture without = draw(cloud, camera);
  cloud.append(make_cloud(
      {.count = 50, .scale_m = {1e25f, 1e25f, 1e25f}}));  // the projected determinant has no float
  rows.push_back({"Gaussians whose projection overflows float",
                  "values that differ from the picture without them", Bound::kAtMost, 0,
                  double(count_different(without.rgba, draw(cloud, camera).rgba))});
  return rows;
}

// The opacity that makes up for the dilation is a root of a ratio of determinants: both may be tiny
// beside each other, underflow, or be zero.
Rows antialiased() {
  Rows rows;
  const Camera camera = front_camera();
  const auto add = [&](const std::string& name, const GaussianSet& set, const Camera& from,
                       double at_least_db, double flip) {
    add_agreement(rows, "antialiased: " + name, compare_with_oracle(set, from, true), at_least_db,
                  flip);
  };
  add("Gaussians of 2 cm", make_cloud({}), camera, 105, kStopFlip);
  add("Gaussians of a quarter of a pixel",
      make_cloud({.count = 15000,
                  .half_size_m = 0.2f,
                  .scale_m = {0.002f, 0.002f, 0.002f},
                  .opacity_low = 0.9,
                  .opacity_high = 1}),
      camera, 100, kStopFlip);
  add("Gaussians of 1,000 km",
      make_cloud(
          {.count = 50, .scale_m = {1e6f, 1e6f, 1e6f}, .opacity_low = 0.02, .opacity_high = 0.2}),
      camera, 105, kCutFlip);
  add("needles of 0.5 m by 1 mm, most of them along the view",
      make_cloud({.count = 5000, .half_size_m = 0.3f, .scale_m = {0.5f, 0.001f, 0.001f}}), camera,
      90, kStopFlip);
  add("discs of 5 cm by 10 um, opacity 1",
      make_cloud({.count = 4000,
                  .half_size_m = 0.4f,
                  .scale_m = {0.05f, 0.05f, 1e-5f},
                  .opacity_low = 1,
                  .opacity_high = 1}),
      camera, 100, kStopFlip);
  // Edge-on to the last bit, points, and determinants that underflow float: nothing is left.
  GaussianSet nothing;
  for (const Vector& scale :
       {Vector{0.1f, 0, 0.1f}, Vector{0.1f, 0, 0}, Vector{0, 0, 0}, Vector{1e-15f, 1e-15f, 1e-15f},
        Vector{1e-25f, 1e-25f, 1e-25f}, Vector{kDenormal, kDenormal, kDenormal}}) {
    nothing.add({0, 0, 0}, factor_of({1, 0, 0, 0}, scale), 1, {1, 1, 1});
  }
  const Picture picture = draw(nothing, camera, {.antialiased = true});
  rows.push_back({"antialiased: discs edge-on, lines, points and determinants that underflow",
                  "pixels drawn", Bound::kAtMost, 0, double(drawn_pixels(picture))});
  rows.push_back({"antialiased: discs edge-on, lines, points and determinants that underflow",
                  "values that are not finite", Bound::kAtMost, 0,
                  double(count_not_finite(picture.rgba))});
  const Picture clear =
      draw(make_cloud({.opacity_low = 0, .opacity_high = 0}), camera, {.antialiased = true});
  rows.push_back(
      {"antialiased: opacity 0", "pixels drawn", Bound::kAtMost, 0, double(drawn_pixels(clear))});
  // A disc of 5 cm that narrows to 0.1 um, its mean on a pixel's centre: the compensation is the
  // root of ab / ((a + e)(b + e)), of variances a and b along the axes, and its determinant goes
  // from 1 to 1e-11 square pixels.
  const Camera on_centre = front_camera(65);
  double off = 0;
  for (float narrow_m = 0.05f; narrow_m > 0.9e-7f; narrow_m *= 0.1f) {
    GaussianSet disc;
    disc.add({0, 0, 0}, factor_of({1, 0, 0, 0}, {0.05f, narrow_m, 0}), 0.9f, {1, 1, 1});
    const Picture seen = draw(disc, on_centre, {.alpha_cut = 1e-6f, .antialiased = true});
    const double px_per_m = double(on_centre.fx_px) / 3, e = double(kAntialiasedDilationPx2),
                 a = std::pow(0.05 * px_per_m, 2), b = std::pow(double(narrow_m) * px_per_m, 2);
    const double expected = double(0.9f) * std::sqrt(a * b / ((a + e) * (b + e)));
    off = std::max(off, std::fabs(double(seen.rgba[4 * (32 * 65 + 32) + 3]) - expected));
  }
  rows.push_back({"antialiased: a disc of 5 cm that narrows to 0.1 um, determinants to 1e-11 px^4",
                  "largest difference of its alpha from the closed form", Bound::kAtMost, 5e-7,
                  off});
  // From 1.5 to 24 m a Gaussian's light falls as its area does. What a pixel's centre sees of one
  // that is smaller than a pixel depends on where it lies between centres, by the sum of a normal
  // density over the grid (Poisson): 1 + 2 sum_k exp(-2 pi^2 k^2 variance) cos(2 pi k offset), up
  // to 28 % an axis; of many at many places it is the area again.
  double worst = 0, least = kInfinity, most = 0;
  for (const float distance_m : {1.5f, 3.0f, 6.0f, 12.0f, 24.0f}) {
    const Camera from = front_camera(64, distance_m);
    const auto summed_alpha = [&](const GaussianSet& set) {
      const Picture seen = draw(set, from, {.alpha_cut = 1e-6f, .antialiased = true});
      double sum = 0;
      for (size_t i = 3; i < seen.rgba.size(); i += 4) sum += seen.rgba[i];
      return sum;
    };
    GaussianSet ball;  // its mean is where four pixels meet
    ball.add({0, 0, 0}, factor_of({1, 0, 0, 0}, {0.01f, 0.01f, 0.01f}), 0.9f, {1, 1, 1});
    const double area = std::pow(double(from.fx_px) * 0.01 / distance_m, 2),
                 variance = area + double(kAntialiasedDilationPx2);
    double grid = 1;
    for (int k = 1; k <= 4; ++k)
      grid += 2 * std::exp(-2 * M_PI * M_PI * k * k * variance) * (k % 2 == 0 ? 1 : -1);
    const double expected = 0.9 * 2 * M_PI * area * grid * grid;
    worst = std::max(worst, std::fabs(summed_alpha(ball) / expected - 1));
    const double light = summed_alpha(make_cloud({.count = 1000,
                                                  .half_size_m = 0.2f * distance_m,
                                                  .scale_m = {0.01f, 0.01f, 0.01f},
                                                  .opacity_low = 0.01,
                                                  .opacity_high = 0.01})) /
                         area;
    least = std::min(least, light);
    most = std::max(most, light);
  }
  rows.push_back({"antialiased: a Gaussian of 1 cm from 1.5 m to 24 m, a pixel of 17 mm to 27 cm",
                  "relative difference of its summed alpha from the closed form", Bound::kAtMost,
                  0.01, worst});
  rows.push_back({"antialiased: a thousand of them, in a cube that grows with the distance",
                  "relative change of their summed alpha over their area", Bound::kAtMost, 0.05,
                  (most - least) / most});
  return rows;
}

Rows opacities() {
  Rows rows;
  const Camera camera = front_camera();
  rows.push_back(
      {"opacity 0", "pixels drawn", Bound::kAtMost, 0,
       double(drawn_pixels(draw(make_cloud({.opacity_low = 0, .opacity_high = 0}), camera)))});
  rows.push_back(
      {"opacity just below the cut", "pixels drawn", Bound::kAtMost, 0,
       double(drawn_pixels(
           draw(make_cloud({.opacity_low = 0.0039215, .opacity_high = 0.0039215}), camera)))});
  add_agreement(rows, "opacity 1", make_cloud({.opacity_low = 1, .opacity_high = 1}), camera, 100,
                kStopFlip);
  const Picture opaque = draw(make_cloud({.count = 200,
                                          .half_size_m = 0.1f,
                                          .scale_m = {1, 1, 1},
                                          .opacity_low = 1,
                                          .opacity_high = 1}),
                              camera);
  double most = 0;
  for (size_t i = 3; i < opaque.rgba.size(); i += 4) most = std::max(most, double(opaque.rgba[i]));
  rows.push_back({"200 layers of opacity 1", "largest alpha", Bound::kAtMost,
                  1 - double(kTransmittanceStop), most});
  add_agreement(rows, "opacity at the cut itself",
                make_cloud({.count = 2000,
                            .half_size_m = 0.05f,
                            .scale_m = {0.5f, 0.5f, 0.5f},
                            .opacity_low = 0.00393,
                            .opacity_high = 0.006}),
                camera, 90, 2 * kCutFlip);
  return rows;
}

Rows many_layers() {
  // alpha 0.01 in the middle; T = 0.99^n passes 1e-4 after 917 layers, and the rest must change
  // nothing.
  GaussianSet layers;
  Random random(3);
  for (int i = 0; i < 100000; ++i) {
    const float shade = static_cast<float>(random.uniform(0, 1));
    layers.add({0, 0, static_cast<float>(random.uniform(-0.5, 0.5))},
               factor_of({1, 0, 0, 0}, {0.3f, 0.3f, 0.001f}), 0.01f, {shade, 1 - shade, 0.5f});
  }
  Rows rows;
  constexpr uint32_t kSize_px = tests::kEmulated ? 24 : 64;  // as many layers in fewer pixels
  const Camera camera = front_camera(kSize_px);
  add_agreement(rows, "100,000 layers of opacity 0.01", layers, camera, 105, 1e-4);
  GaussianSet faint;
  for (int i = 0; i < 100000; ++i) {
    faint.add({0, 0, static_cast<float>(random.uniform(-0.5, 0.5))},
              factor_of({1, 0, 0, 0}, {3, 3, 0.001f}), 1.01f / 255, {1, 0.5f, 0.25f});
  }
  const Picture picture = draw(faint, camera);
  // Straight colour of equal layers is their colour, however many there are.
  const float* middle = &picture.rgba[4 * (kSize_px / 2 * kSize_px + kSize_px / 2)];
  rows.push_back({"100,000 layers of opacity 1.01/255, all of one colour",
                  "error of the straight colour", Bound::kAtMost, 2e-5,
                  std::max({std::abs(middle[0] - 1.0), std::abs(middle[1] - 0.5),
                            std::abs(middle[2] - 0.25)})});
  rows.push_back({"100,000 layers of opacity 1.01/255, all of one colour", "transmittance left",
                  Bound::kAtMost, 1.01e-4, 1.0 - middle[3]});
  return rows;
}

// The scene and its camera moved together: what is left is the rounding of positions and of the
// translation.
Rows far_from_the_origin() {
  Rows rows;
  for (const auto& [distance, limit] :
       {std::pair<float, double>{100, 80}, {1000, 62}, {10000, 42}}) {
    GaussianSet set = make_cloud({.centre_m = {distance, 0, -distance}});
    // Turned, so that the products of the view transform round: an axis-aligned camera would
    // subtract exactly.
    const Result<Camera> camera = make_orbit_camera(
        {.azimuth_deg = 30, .elevation_deg = 20, .target_m = {distance, 0, -distance}}, 256, 256);
    const std::string name =
        "the scene " + std::to_string(int(distance)) + " m from the origin along x and z";
    const Agreement agreement = compare_with_oracle(set, *camera);
    rows.push_back({name, "foreground psnr_db against the float64 oracle", Bound::kAtLeast, limit,
                    agreement.psnr_db});
    rows.push_back(
        {name, "values that are not finite", Bound::kAtMost, 0, double(agreement.not_finite)});
  }
  return rows;
}

Rows fields_of_view() {
  Rows rows;
  add_agreement(rows, "field of view of 1 degree",
                make_cloud({.half_size_m = 0.02f, .scale_m = {0.0005f, 0.0005f, 0.0002f}}),
                front_camera(256, 3, 1), 85, kCutFlip);
  add_agreement(rows, "field of view of 170 degrees",
                make_cloud({.count = 4000, .half_size_m = 2.5f, .scale_m = {0.2f, 0.2f, 0.05f}}),
                front_camera(256, 3, 170), 105, kStopFlip);
  // Far outside on one side the Jacobian's tangents are clamped; a large Gaussian there still
  // reaches into the picture.
  add_agreement(rows, "large Gaussians far outside the frustum",
                make_cloud({.count = 400, .centre_m = {4, 1, 0}, .scale_m = {2, 1, 0.5f}}),
                front_camera(), 90, kStopFlip);
  Camera aside = front_camera();
  aside.cx_px =
      700;  // the principal point far outside the image, as a crop of a large picture has it
  aside.cy_px = -300;
  add_agreement(rows, "principal point outside the image",
                make_cloud({.centre_m = {-4.88f, -3.65f, 0}}), aside, 100, kCutFlip);
  return rows;
}

Rows denormals() {
  Rows rows;
  const Camera camera = front_camera();
  GaussianSet set = make_cloud({});
  for (size_t i = 0; i < set.covariance_factor.size(); i += 2)
    set.covariance_factor[i] = i % 4 == 0 ? kDenormal : -100 * kDenormal;
  for (size_t i = 0; i < set.position_m.size(); i += 5) set.position_m[i] = 3 * kDenormal;
  add_agreement(rows, "denormal positions and factors", set, camera, 105, kStopFlip);
  GaussianSet dark = make_cloud({});
  for (float& value : dark.sh) value = -kShOffset / kSh0 + 1e-7f;  // colours next to nothing
  const Picture picture = draw(dark, camera);
  rows.push_back({"colours of 1e-8", "values that are not finite", Bound::kAtMost, 0,
                  double(count_not_finite(picture.rgba))});
  rows.push_back({"colours of 1e-8", "largest colour", Bound::kAtMost, 1e-7, [&] {
                    double most = 0;
                    for (size_t i = 0; i < picture.rgba.size(); ++i)
                      most = i % 4 == 3 ? most : std::max(most, double(picture.rgba[i]));
                    return most;
                  }()});
  return rows;
}

Rows not_a_number() {
  const Camera camera = front_camera();
  const GaussianSet sound = make_cloud({});
  const Picture expected = draw(sound, camera);
  GaussianSet mixed;
  Random random(4);
  size_t unsound = 0;
  for (uint32_t i = 0; i < sound.count(); ++i) {
    for (float bad : {kNan, kInfinity, -kInfinity}) {
      Vector position{0, 0, 0}, colour{0.5f, 0.5f, 0.5f};
      std::array<float, 9> factor = factor_of({1, 0, 0, 0}, {0.1f, 0.1f, 0.1f});
      float opacity = 0.9f;
      switch (unsound++ % 4) {
        case 0:
          position[i % 3] = bad;
          break;
        case 1:
          factor[i % 9] = bad;
          break;
        case 2:
          opacity = bad;
          break;
        case 3:
          colour[i % 3] = bad;
          break;
      }
      mixed.add(position, factor, opacity, colour);
    }
    GaussianSet one;
    one.position_m.assign(&sound.position_m[3 * i], &sound.position_m[3 * i] + 3);
    one.covariance_factor.assign(&sound.covariance_factor[9 * i],
                                 &sound.covariance_factor[9 * i] + 9);
    one.opacity = {sound.opacity[i]};
    one.sh.assign(&sound.sh[3 * i], &sound.sh[3 * i] + 3);
    mixed.append(one);
  }
  const Picture picture = draw(mixed, camera);
  return {{"6,000 Gaussians with NaN or infinity among 2,000 sound ones",
           "values that differ from the picture of the sound ones", Bound::kAtMost, 0,
           double(count_different(expected.rgba, picture.rgba))},
          {"6,000 Gaussians with NaN or infinity among 2,000 sound ones",
           "share of Gaussians left after culling", Bound::kAtMost, 0.25, visible_share(picture)}};
}

Rows order() {
  Rows rows;
  const Camera camera = front_camera();
  GaussianSet flat = make_cloud({});
  for (size_t i = 2; i < flat.position_m.size(); i += 3)
    flat.position_m[i] = 0;  // one depth for all: the index decides
  add_agreement(rows, "2,000 Gaussians of equal depth", flat, camera, 105, kStopFlip);
  const GaussianView view = flat.view();
  const Picture one = draw({&view, 1}, camera, 1);
  size_t different = 0;
  for (uint32_t threads : {2u, 3u, 8u})
    different += count_different(one.rgba, draw({&view, 1}, camera, threads).rgba);
  rows.push_back({"the same frame with 1, 2, 3 and 8 threads", "values that differ", Bound::kAtMost,
                  0, double(different)});
  // Depths from 0.3 m to 3,000 km: integer or normalised depths would lose the near ones.
  GaussianSet deep;
  Random random(5);
  for (int i = 0; i < 3000; ++i) {
    const float depth = static_cast<float>(std::pow(10.0, random.uniform(-0.5, 6.5)));
    const float aside = 0.3f * depth;
    deep.add(
        {static_cast<float>(random.uniform(-aside, aside)),
         static_cast<float>(random.uniform(-aside, aside)), 3 - depth},
        factor_of(random.quaternion(), {0.02f * depth, 0.02f * depth, 0.01f * depth}), 0.6f,
        {static_cast<float>(random.uniform(0, 1)), static_cast<float>(random.uniform(0, 1)), 0.5f});
  }
  add_agreement(rows, "depths from 0.3 m to 3,000 km", deep, camera, 105, kStopFlip);
  return rows;
}

// A pixel of the fast tier stops with less than 1/255 of its light left, where the exact one goes
// on; on top of it one contribution may fall on the other side of the exact stop, or of the cut.
constexpr double kFastStop = 1.0 / 255 + kStopFlip;

void add_fast_blend(Rows& rows, const std::string& name, const GaussianSet& set,
                    const Camera& camera) {
  const GaussianView view = set.view();
  const Picture exact = draw({&view, 1}, camera),
                fast = draw({&view, 1}, camera, 1, {}, {.fast_blend = true});
  double largest = 0;
  for (size_t i = 0; i < exact.rgba.size(); i += 4) {
    const double a = exact.rgba[i + 3], b = fast.rgba[i + 3];
    largest = std::max(largest, std::fabs(a - b));
    for (size_t c = i; c < i + 3; ++c)
      largest = std::max(largest, std::fabs(double(exact.rgba[c]) * a - double(fast.rgba[c]) * b));
  }
  if (count_not_finite(fast.rgba) > 0) largest = kNan;
  rows.push_back({"fast blend: " + name,
                  "largest difference of a premultiplied channel from the exact tier",
                  Bound::kAtMost, kFastStop, largest});
}

Rows fast_blend() {
  Rows rows;
  const Camera camera = front_camera();
  add_fast_blend(rows, "discs", make_cloud({}), camera);
  add_fast_blend(rows, "discs of thickness 0", make_cloud({.scale_m = {0.02f, 0.02f, 0}}), camera);
  add_fast_blend(rows, "needles of 0.5 m by 5 um", make_cloud({.scale_m = {0.5f, 5e-6f, 5e-6f}}),
                 camera);
  add_fast_blend(rows, "needles of 5 m by 5 nm",
                 make_cloud({.count = 500, .scale_m = {5, 5e-9f, 5e-9f}}), camera);
  add_fast_blend(rows, "points of extent 0",
                 make_cloud({.count = 20000, .half_size_m = 0.4f, .scale_m = {0, 0, 0}}), camera);
  add_fast_blend(rows, "opacity 1", make_cloud({.opacity_low = 1, .opacity_high = 1}), camera);
  add_fast_blend(rows, "opacity at the cut",
                 make_cloud({.opacity_low = kAlphaCut, .opacity_high = 1.01 * kAlphaCut}), camera);
  add_fast_blend(rows, "larger than the screen",
                 make_cloud({.count = 200, .scale_m = {20, 20, 20}}), camera);
  GaussianSet layers;
  for (int i = 0; i < 20000; ++i)
    layers.add({0, 0, 1e-5f * static_cast<float>(i)}, factor_of({1, 0, 0, 0}, {0.3f, 0.3f, 0.001f}),
               0.01f, {i % 2 == 0 ? 1.0f : 0.0f, 0.5f, 0.25f});
  add_fast_blend(rows, "20,000 layers of opacity 0.01", layers, front_camera(32));
  return rows;
}

constexpr Case kCases[] = {{"NearSingularCovariances", near_singular},
                           {"Needles", needles},
                           {"NearPlane", near_plane},
                           {"BehindTheCamera", behind_the_camera},
                           {"SmallerThanAPixel", below_a_pixel},
                           {"LargerThanTheScreen", above_the_screen},
                           {"Antialiased", antialiased},
                           {"Opacities", opacities},
                           {"ManyTransparentLayers", many_layers},
                           {"FarFromTheOrigin", far_from_the_origin},
                           {"FieldsOfView", fields_of_view},
                           {"Denormals", denormals},
                           {"NotANumber", not_a_number},
                           {"OrderAndThreads", order},
                           {"FastBlend", fast_blend}};

}  // namespace
}  // namespace splat

std::span<const Case> splat_cases() { return splat::kCases; }

}  // namespace figurine::stability
