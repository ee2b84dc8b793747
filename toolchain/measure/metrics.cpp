#include "toolchain/measure/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/check.h"

namespace figurine::measure {

namespace {

constexpr uint8_t kOpaqueAlpha = 250;  // 249/255 < 0.98 < 250/255
constexpr int kErosion_px = 3;         // of the mask, where holes are looked for

void check_sizes(const Picture& a, const Picture& b) {
  FIG_CHECK(
      a.width_px == b.width_px && a.height_px == b.height_px && a.rgba.size() == b.rgba.size(),
      "pictures of one size");
}

Box whole(const Picture& picture) {
  return {0, 0, static_cast<int>(picture.width_px), static_cast<int>(picture.height_px)};
}

Box clip(const Box& box, const Picture& picture) {
  const Box all = whole(picture);
  return {std::max(box.x0, 0), std::max(box.y0, 0), std::min(box.x1, all.x1),
          std::min(box.y1, all.y1)};
}

float over_grey(const Picture& picture, size_t pixel, int channel) {
  const uint8_t* p = &picture.rgba[4 * pixel];
  return (static_cast<float>(p[channel]) + static_cast<float>(255 - p[3]) * kMidGrey) / 255.0f;
}

// Whether all pixels up to `reach` away in x and y are foreground. They must be in the picture.
bool is_foreground_around(const Picture& truth, int x, int y, int reach) {
  for (int j = y - reach; j <= y + reach; ++j) {
    for (int i = x - reach; i <= x + reach; ++i) {
      if (!is_foreground(truth, size_t(j) * truth.width_px + i)) return false;
    }
  }
  return true;
}

// The pixel minus the mean of its 3x3 neighbourhood, which must be in the picture.
double high_pass_at(const Picture& picture, int x, int y, int channel) {
  double sum = 0;
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i)
      sum += over_grey(picture, size_t(j) * picture.width_px + i, channel);
  }
  return over_grey(picture, size_t(y) * picture.width_px + x, channel) - sum / 9;
}

}  // namespace

Picture quantise_picture(uint32_t width_px, uint32_t height_px, std::span<const float> rgba) {
  FIG_CHECK(rgba.size() == size_t(width_px) * height_px * 4, "four floats a pixel");
  Picture picture{width_px, height_px, std::vector<uint8_t>(rgba.size())};
  for (size_t i = 0; i < rgba.size(); ++i) {
    const float value = std::isfinite(rgba[i]) ? rgba[i] : 0.0f;
    picture.rgba[i] = static_cast<uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f);
  }
  return picture;
}

Box bounding_box(const Picture& picture) {
  Box box{static_cast<int>(picture.width_px), static_cast<int>(picture.height_px), 0, 0};
  for (int y = 0; y < static_cast<int>(picture.height_px); ++y) {
    for (int x = 0; x < static_cast<int>(picture.width_px); ++x) {
      if (picture.rgba[(size_t(y) * picture.width_px + x) * 4 + 3] == 0) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1),
             std::max(box.y1, y + 1)};
    }
  }
  return box.empty() ? Box{} : box;
}

double SquaredError::psnr_db() const {
  if (count == 0) return std::numeric_limits<double>::quiet_NaN();
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10 * std::log10(mse());
}

Outline compare_outlines(const Picture& prediction, const Picture& truth) {
  check_sizes(prediction, truth);
  Outline outline;
  for (size_t pixel = 0; pixel < truth.rgba.size() / 4; ++pixel) {
    const bool in_truth = is_foreground(truth, pixel),
               in_prediction = is_foreground(prediction, pixel);
    outline.add(
        {.both = in_truth && in_prediction, .truth = in_truth, .prediction = in_prediction});
  }
  return outline;
}

SquaredError foreground_error(const Picture& prediction, const Picture& truth) {
  return foreground_error(prediction, truth, whole(truth));
}

SquaredError foreground_error(const Picture& prediction, const Picture& truth, const Box& inside) {
  check_sizes(prediction, truth);
  const Box box = clip(inside, truth);
  SquaredError error;
  for (int y = box.y0; y < box.y1; ++y) {
    for (int x = box.x0; x < box.x1; ++x) {
      const size_t pixel = size_t(y) * truth.width_px + x;
      if (!is_foreground(truth, pixel)) continue;
      for (int c = 0; c < 3; ++c) {
        const double difference =
            double(over_grey(prediction, pixel, c)) - over_grey(truth, pixel, c);
        error.sum += difference * difference;
      }
      error.count += 3;
    }
  }
  return error;
}

SquaredError crop_error(const Picture& prediction, const Picture& truth) {
  check_sizes(prediction, truth);
  const Box box = bounding_box(truth);
  SquaredError error;
  for (int y = box.y0; y < box.y1; ++y) {
    for (int x = box.x0; x < box.x1; ++x) {
      const size_t at = (size_t(y) * truth.width_px + x) * 4;
      for (int c = 0; c < 3; ++c) {
        const double difference =
            (double(prediction.rgba[at + c]) - double(truth.rgba[at + c])) / 255.0;
        error.sum += difference * difference;
      }
      error.count += 3;
    }
  }
  return error;
}

SquaredError difference_error(const Picture& prediction0, const Picture& prediction1,
                              const Picture& truth0, const Picture& truth1) {
  check_sizes(prediction0, truth0);
  check_sizes(prediction1, truth1);
  check_sizes(truth0, truth1);
  SquaredError error;
  for (size_t pixel = 0; pixel < truth0.rgba.size() / 4; ++pixel) {
    if (!is_foreground(truth0, pixel) || !is_foreground(truth1, pixel)) continue;
    for (int c = 0; c < 3; ++c) {
      const double predicted =
          double(over_grey(prediction1, pixel, c)) - over_grey(prediction0, pixel, c);
      const double actual = double(over_grey(truth1, pixel, c)) - over_grey(truth0, pixel, c);
      error.sum += (predicted - actual) * (predicted - actual);
    }
    error.count += 3;
  }
  return error;
}

HighPass high_pass(const Picture& prediction, const Picture& truth) {
  return high_pass(prediction, truth, whole(truth));
}

HighPass high_pass(const Picture& prediction, const Picture& truth, const Box& inside) {
  check_sizes(prediction, truth);
  Box box = clip(inside, truth);
  const int width = static_cast<int>(truth.width_px), height = static_cast<int>(truth.height_px);
  box = {std::max(box.x0, 1), std::max(box.y0, 1), std::min(box.x1, width - 1),
         std::min(box.y1, height - 1)};
  HighPass energy;
  for (int y = box.y0; y < box.y1; ++y) {
    for (int x = box.x0; x < box.x1; ++x) {
      if (!is_foreground_around(truth, x, y, 1)) continue;
      for (int c = 0; c < 3; ++c) {
        const double predicted = high_pass_at(prediction, x, y, c),
                     actual = high_pass_at(truth, x, y, c);
        energy.add({.prediction = predicted * predicted,
                    .truth = actual * actual,
                    .product = predicted * actual});
      }
    }
  }
  return energy;
}

Filled count_filled(const Picture& prediction, const Picture& truth) {
  check_sizes(prediction, truth);
  Filled filled;
  for (int y = kErosion_px; y < static_cast<int>(truth.height_px) - kErosion_px; ++y) {
    for (int x = kErosion_px; x < static_cast<int>(truth.width_px) - kErosion_px; ++x) {
      const size_t alpha = (size_t(y) * truth.width_px + x) * 4 + 3;
      if (truth.rgba[alpha] < kOpaqueAlpha || !is_foreground_around(truth, x, y, kErosion_px))
        continue;
      filled.add({.inside = 1, .filled = prediction.rgba[alpha] >= kOpaqueAlpha});
    }
  }
  return filled;
}

void FlatColour::add(const Picture& truth) {
  for (size_t pixel = 0; pixel < truth.rgba.size() / 4; ++pixel) {
    if (!is_foreground(truth, pixel)) continue;
    const double alpha = truth.rgba[4 * pixel + 3] / 255.0;
    alpha2_ += alpha * alpha;
    ++pixels_;
    for (int c = 0; c < 3; ++c) {
      const double residual =
          truth.rgba[4 * pixel + c] / 255.0;  // premultiplied: over grey minus (1 - a) grey
      alpha_residual_[c] += alpha * residual;
      residual2_[c] += residual * residual;
    }
  }
}

std::array<double, 3> FlatColour::colour() const {
  std::array<double, 3> colour{0, 0, 0};
  if (alpha2_ > 0) {
    for (int c = 0; c < 3; ++c) colour[c] = alpha_residual_[c] / alpha2_;
  }
  return colour;
}

SquaredError FlatColour::error() const {
  SquaredError error{0, 3 * pixels_};
  const std::array<double, 3> best = colour();
  // sum (r - a c)^2 = sum r^2 - 2 c sum a r + c^2 sum a^2
  for (int c = 0; c < 3; ++c)
    error.sum += std::max(
        0.0, residual2_[c] - 2 * best[c] * alpha_residual_[c] + best[c] * best[c] * alpha2_);
  return error;
}

}  // namespace figurine::measure
