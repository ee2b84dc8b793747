#include "samples/common/framing.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace figurine::samples {

namespace {

// The value below which the share of values lies. Reorders.
float quantile(std::vector<float>& values, double share) {
  const auto rank = static_cast<size_t>(
      std::clamp(share, 0.0, 1.0) * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank),
                   values.end());
  return values[rank];
}

bool finite(const Point& point) {
  return std::isfinite(point[0]) && std::isfinite(point[1]) && std::isfinite(point[2]);
}

}  // namespace

Result<Framing> parse_framing(const std::string& text) {
  if (text == "body") return Framing::kBody;
  if (text == "bust") return Framing::kBust;
  if (text == "head") return Framing::kHead;
  return Status(StatusCode::kInvalidArgument,
                "framing: '" + text + "' is none of body, bust, head");
}

Result<std::vector<uint8_t>> framed_joints(const Body& body, Framing framing) {
  constexpr std::array<const char*, 7> kNames{"head",        "jaw",  "left_eye",    "right_eye",
                                              "left_collar", "neck", "right_collar"};
  const size_t names = framing == Framing::kBust ? kNames.size() : 4;
  std::vector<uint8_t> joints;
  for (size_t i = 0; i < names; ++i) {
    const auto found = std::find(body.joint_names.begin(), body.joint_names.end(), kNames[i]);
    if (found != body.joint_names.end()) {
      joints.push_back(static_cast<uint8_t>(found - body.joint_names.begin()));
    } else if (i == 0) {
      return Status(StatusCode::kUnsupported,
                    "framing: body '" + body.name + "' has no joint called head");
    }
  }
  return joints;
}

bool moved_most_by(const Body& body, uint32_t texel, std::span<const uint8_t> joints) {
  const float* weights = &body.texel_weights[size_t(texel) * kSkinInfluences];
  const uint8_t joint =
      body.texel_joints[size_t(texel) * kSkinInfluences +
                        static_cast<size_t>(std::max_element(weights, weights + kSkinInfluences) -
                                            weights)];
  return std::find(joints.begin(), joints.end(), joint) != joints.end();
}

float fit_distance_m(std::span<const Point> points, const OrbitCamera& orbit, double aspect,
                     const FramingOptions& options) {
  constexpr double kRadians = 3.14159265358979323846 / 180;
  const double azimuth = orbit.azimuth_deg * kRadians, elevation = orbit.elevation_deg * kRadians;
  const glm::dvec3 toward(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                          std::cos(azimuth) * std::cos(elevation));
  const glm::dvec3 right(std::cos(azimuth), 0, -std::sin(azimuth));
  const glm::dvec3 up = glm::cross(toward, right);
  const glm::vec3 target(orbit.target_m[0], orbit.target_m[1], orbit.target_m[2]);
  const double tangent_y = std::tan(0.5 * orbit.vertical_fov_deg * kRadians) * (1 - options.margin);
  const double tangent_x =
      std::tan(0.5 * orbit.vertical_fov_deg * kRadians) * aspect * (1 - options.margin);
  // A point at (x, y) across the view and t towards the camera is inside if |x| <= (D - t)
  // tangent_x and |y| <= (D - t) tangent_y.
  std::vector<float> needed;
  for (const Point& point : points) {
    if (!finite(point)) continue;
    const glm::dvec3 d(glm::vec3(point[0], point[1], point[2]) - target);
    const double x = glm::dot(right, d), y = glm::dot(up, d), t = glm::dot(toward, d);
    needed.push_back(
        static_cast<float>(t + std::max(std::abs(x) / tangent_x, std::abs(y) / tangent_y)));
  }
  if (needed.empty()) return orbit.distance_m;
  return std::max(quantile(needed, options.share), 1e-3f);
}

Point robust_centre(std::span<const Point> points, double share) {
  Point centre{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    std::vector<float> values;
    for (const Point& point : points) {
      if (finite(point)) values.push_back(point[k]);
    }
    if (values.empty()) return {0, 0, 0};
    const float low = quantile(values, 0.5 * (1 - share)),
                high = quantile(values, 1 - 0.5 * (1 - share));
    centre[k] = 0.5f * (low + high);
  }
  return centre;
}

std::vector<Point> smooth_path(std::span<const Point> path, double sigma_frames) {
  std::vector<Point> result(path.begin(), path.end());
  if (!(sigma_frames > 0)) return result;
  const auto reach = static_cast<int64_t>(std::ceil(3 * sigma_frames)),
             count = static_cast<int64_t>(path.size());
  for (int64_t i = 0; i < count; ++i) {
    double weights = 0, first = 0, second = 0, value[3] = {0, 0, 0}, slope[3] = {0, 0, 0};
    for (int64_t j = std::max<int64_t>(0, i - reach); j <= std::min(count - 1, i + reach); ++j) {
      const double d = static_cast<double>(j - i) / sigma_frames, weight = std::exp(-0.5 * d * d);
      weights += weight;
      first += weight * d;
      second += weight * d * d;
      for (int k = 0; k < 3; ++k) {
        value[k] += weight * path[static_cast<size_t>(j)][k];
        slope[k] += weight * d * path[static_cast<size_t>(j)][k];
      }
    }
    const double determinant = weights * second - first * first;
    for (int k = 0; k < 3; ++k) {
      const double smooth = determinant > 1e-12 * weights * weights
                                ? (second * value[k] - first * slope[k]) / determinant
                                : value[k] / weights;
      result[static_cast<size_t>(i)][k] = static_cast<float>(smooth);
    }
  }
  return result;
}

}  // namespace figurine::samples
