#include "toolchain/dataset/lens.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

constexpr double kLargest = 100;
constexpr int kSteps = 64;  // along a ray from the middle to a corner

struct Corner {
  double x, y;
};

std::array<Corner, 8> border(const Camera& camera) {
  const double left = -camera.cx_px / camera.fx_px, top = -camera.cy_px / camera.fy_px,
               right = (camera.width_px - camera.cx_px) / camera.fx_px,
               bottom = (camera.height_px - camera.cy_px) / camera.fy_px;
  return {{{left, top},
           {0, top},
           {right, top},
           {left, 0},
           {right, 0},
           {left, bottom},
           {0, bottom},
           {right, bottom}}};
}

}  // namespace

bool Lens::bends() const {
  return std::any_of(k.begin(), k.end(), [](double value) { return value != 0; });
}

Lens make_lens(const std::vector<double>& values, const std::string& where) {
  const size_t count = values.size();
  if (count != 0 && count != 4 && count != 5 && count != 8 && count != 12 && count != 14) {
    throw InputError(where + ": has " + std::to_string(count) +
                     " numbers; 4, 5 or 8 are read (Brown and Conrady, in OpenCV's order)");
  }
  for (size_t i = 8; i < count; ++i) {
    if (values[i] != 0) {
      throw InputError(where +
                       ": has thin prism or tilt coefficients, which are not read; only "
                       "the first 8 may differ from zero");
    }
  }
  Lens lens;
  for (size_t i = 0; i < std::min<size_t>(count, 8); ++i) {
    if (!(std::abs(values[i]) <= kLargest))
      throw InputError(where + ": number " + std::to_string(i + 1) + " is no lens's");
    lens.k[i] = values[i];
  }
  return lens;
}

std::array<double, 2> distort(const Lens& lens, double x, double y) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = lens.k;
  const double r2 = x * x + y * y;
  const double radial =
      (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

bool is_one_to_one(const Camera& camera, const Lens& lens) {
  for (const Corner& corner : border(camera)) {
    double before = 0;
    for (int i = 1; i <= kSteps; ++i) {
      const double share = static_cast<double>(i) / kSteps;
      const std::array<double, 2> bent = distort(lens, corner.x * share, corner.y * share);
      // Along the ray: a sideways shift does not count.
      const double along = (bent[0] * corner.x + bent[1] * corner.y) /
                           std::max(1e-12, std::hypot(corner.x, corner.y));
      if (!(along > before)) return false;
      before = along;
    }
  }
  return true;
}

ports::ImageU8 undistort(const ports::ImageU8& image, const Camera& camera, const Lens& lens) {
  const uint32_t channels = image.channels;
  const auto width = static_cast<int64_t>(image.width_px),
             height = static_cast<int64_t>(image.height_px);
  ports::ImageU8 straight(image.width_px, image.height_px, channels);
  const auto add = [&](int64_t x, int64_t y, double weight, double* sum) {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const uint8_t* from = image.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
    for (uint32_t c = 0; c < channels; ++c) sum[c] += weight * from[c];
  };
  for (int64_t v = 0; v < height; ++v) {
    for (int64_t u = 0; u < width; ++u) {
      const double x = (static_cast<double>(u) + 0.5 - camera.cx_px) / camera.fx_px,
                   y = (static_cast<double>(v) + 0.5 - camera.cy_px) / camera.fy_px;
      const std::array<double, 2> bent = distort(lens, x, y);
      const double from_x = bent[0] * camera.fx_px + camera.cx_px - 0.5,
                   from_y = bent[1] * camera.fy_px + camera.cy_px - 0.5;
      if (!(from_x > -1 && from_y > -1 && from_x < static_cast<double>(width) &&
            from_y < static_cast<double>(height)))
        continue;
      const double floor_x = std::floor(from_x), floor_y = std::floor(from_y);
      const double right = from_x - floor_x, down = from_y - floor_y;
      const auto x0 = static_cast<int64_t>(floor_x), y0 = static_cast<int64_t>(floor_y);
      double sum[4] = {0, 0, 0, 0};
      add(x0, y0, (1 - right) * (1 - down), sum);
      add(x0 + 1, y0, right * (1 - down), sum);
      add(x0, y0 + 1, (1 - right) * down, sum);
      add(x0 + 1, y0 + 1, right * down, sum);
      uint8_t* to = straight.at(static_cast<uint32_t>(u), static_cast<uint32_t>(v));
      for (uint32_t c = 0; c < channels; ++c)
        to[c] = static_cast<uint8_t>(std::lround(std::clamp(sum[c], 0.0, 255.0)));
    }
  }
  return straight;
}

}  // namespace figurine::dataset
