// The origin: floats near 4,649,776 m are 0.5 m apart, and a renderer's sums in float lose as much
// again. The middle of the Gaussians, rounded to whole numbers, is subtracted in double: what was a
// float stays exact, what was a double keeps its digits. Scenes near zero stay as they are.
#include "ports/gaussians/cloud_builder.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace figurine::ports {

namespace {

// Of the middle's coordinates. At 64 m a step of a float is 4 micrometres.
constexpr double kNear_m = 64;
// Far beyond any scene, and differences of two of them are floats.
constexpr double kFurthest_m = 1e37;

bool narrow(double value, float& to) {
  to = static_cast<float>(value);
  return std::isfinite(to);
}

double median(const std::vector<double>& positions, size_t axis) {
  std::vector<double> values(positions.size() / 3);
  for (size_t i = 0; i < values.size(); ++i) values[i] = positions[3 * i + axis];
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Of a quaternion of any length, wxyz; the identity of one of none. False if it is not finite.
bool rotation_matrix(const std::array<double, 4>& quaternion, double* matrix, bool& unrotated) {
  double largest = 0;
  for (const double value : quaternion) {
    if (!std::isfinite(value)) return false;
    largest = std::max(largest, std::abs(value));
  }
  unrotated = largest == 0;
  std::array<double, 4> q{1, 0, 0, 0};
  if (!unrotated) {
    double length2 = 0;
    for (size_t k = 0; k < 4; ++k) {
      q[k] = quaternion[k] / largest;  // squares neither overflow nor vanish
      length2 += q[k] * q[k];
    }
    for (double& value : q) value /= std::sqrt(length2);
  }
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double rows[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),  //
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  std::copy_n(rows, 9, matrix);
  return true;
}

}  // namespace

bool find_sh_layout(size_t values, ShLayout& layout) {
  if (values % 3 != 0) return false;
  layout = {.stored_per_channel = values / 3};
  uint32_t stored = 0;  // the highest whole band in the file
  while (sh_coefficients(stored + 1) - 1 <= layout.stored_per_channel) ++stored;
  layout.degree = std::min(stored, kMaxShDegree);
  if (sh_coefficients(layout.degree) - 1 == layout.stored_per_channel) return true;
  layout.remark = sh_coefficients(stored) - 1 == layout.stored_per_channel
                      ? "spherical harmonics of degree " + std::to_string(stored)
                      : std::to_string(layout.stored_per_channel + 1) +
                            " spherical harmonics a channel, no whole degree";
  layout.remark += ", read to degree " + std::to_string(layout.degree);
  return true;
}

CloudBuilder::CloudBuilder(std::string container, uint32_t sh_degree, size_t count) {
  cloud_.container = std::move(container);
  cloud_.sh_degree = sh_degree;
  position_m_.reserve(3 * count);
  cloud_.covariance_factor.reserve(9 * count);
  cloud_.opacity.reserve(count);
  cloud_.sh.reserve(3 * size_t(sh_coefficients(sh_degree)) * count);
}

void CloudBuilder::leave_out(uint64_t row, const std::string& why) {
  if (cloud_.left_out++ == 0) cloud_.left_out_why = "Gaussian " + std::to_string(row) + ": " + why;
}

void CloudBuilder::add(uint64_t row, const StoredGaussian& gaussian) {
  for (const double value : gaussian.position_m) {
    if (!(std::abs(value) <= kFurthest_m))
      return leave_out(row, std::isfinite(value) ? "its position is beyond 10^37"
                                                 : "its position is not finite");
  }
  double matrix[9];
  bool unrotated = false;
  if (!rotation_matrix(gaussian.rotation, matrix, unrotated))
    return leave_out(row, "its rotation is not finite");
  float factor[9];
  for (size_t i = 0; i < 9; ++i) {
    const double scale = gaussian.scale_m[i % 3];
    if (!(scale >= 0) || !narrow(matrix[i] * scale, factor[i]))
      return leave_out(row, scale < 0 ? "a scale is negative" : "its scale is not finite");
  }
  if (std::isnan(gaussian.opacity)) return leave_out(row, "its opacity is not a number");
  const size_t colours = 3 * size_t(sh_coefficients(cloud_.sh_degree));
  float colour[3 * sh_coefficients(kMaxShDegree)];
  for (size_t k = 0; k < colours; ++k) {
    if (!narrow(gaussian.sh[k], colour[k])) return leave_out(row, "its colour is not finite");
  }
  position_m_.insert(position_m_.end(), gaussian.position_m.begin(), gaussian.position_m.end());
  cloud_.covariance_factor.insert(cloud_.covariance_factor.end(), factor, factor + 9);
  cloud_.opacity.push_back(static_cast<float>(std::clamp(gaussian.opacity, 0.0, 1.0)));
  cloud_.sh.insert(cloud_.sh.end(), colour, colour + colours);
  unrotated_ += unrotated;
}

GaussianCloud CloudBuilder::finish() && {
  if (unrotated_ > 0)
    remark(std::to_string(unrotated_) + " without a rotation (quaternion 0), left unrotated");
  if (!position_m_.empty()) {
    std::array<double, 3> middle{};
    for (size_t axis = 0; axis < 3; ++axis) middle[axis] = std::round(median(position_m_, axis));
    const bool far = std::any_of(middle.begin(), middle.end(),
                                 [](double value) { return std::abs(value) > kNear_m; });
    if (far) cloud_.origin_m = middle;
  }
  cloud_.position_m.resize(position_m_.size());
  for (size_t i = 0; i < position_m_.size(); ++i)
    cloud_.position_m[i] = static_cast<float>(position_m_[i] - cloud_.origin_m[i % 3]);
  return std::move(cloud_);
}

}  // namespace figurine::ports
