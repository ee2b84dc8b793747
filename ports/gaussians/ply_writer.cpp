#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "ports/gaussians/decompose.h"
#include "ports/gaussians/ply.h"

namespace figurine::ports {

namespace {

constexpr double kMaxLogit = 16;      // sigmoid(16) = 1 - 1.1e-7: one step of a float below 1
constexpr double kMinLogScale = -30;  // 1e-13 m

std::string header_of(const GaussianView& gaussians, const PlyWriting& writing, bool far) {
  const uint32_t rest = 3 * (sh_coefficients(gaussians.sh_degree) - 1);
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : writing.comments) header += "comment " + comment + "\n";
  header += "element vertex " + std::to_string(gaussians.count) + "\n";
  const auto declare = [&](const std::string& property, const char* type = "float") {
    header += std::string("property ") + type + " " + property + "\n";
  };
  for (const char* property : {"x", "y", "z"}) declare(property, far ? "double" : "float");
  for (const char* property : {"nx", "ny", "nz"}) declare(property);
  for (int k = 0; k < 3; ++k) declare("f_dc_" + std::to_string(k));
  for (uint32_t k = 0; k < rest; ++k) declare("f_rest_" + std::to_string(k));
  declare("opacity");
  for (int k = 0; k < 3; ++k) declare("scale_" + std::to_string(k));
  for (int k = 0; k < 4; ++k) declare("rot_" + std::to_string(k));
  return header + "end_header\n";
}

template <class T>
std::byte* put(std::byte* to, T value) {
  std::memcpy(to, &value, sizeof(T));
  return to + sizeof(T);
}

}  // namespace

std::vector<std::byte> write_gaussian_ply(const GaussianView& gaussians,
                                          const PlyWriting& writing) {
  const uint32_t coefficients = sh_coefficients(gaussians.sh_degree);
  const auto& origin = writing.origin_m;
  const bool far = std::any_of(origin.begin(), origin.end(), [](double v) { return v != 0; });
  const std::string header = header_of(gaussians, writing, far);
  const size_t row_bytes = 3 * (far ? sizeof(double) : sizeof(float)) +
                           (3 + 3 * size_t(coefficients) + 1 + 3 + 4) * sizeof(float);
  std::vector<std::byte> bytes(header.size() + row_bytes * gaussians.count);
  std::memcpy(bytes.data(), header.data(), header.size());
  std::byte* to = bytes.data() + header.size();
  for (size_t i = 0; i < gaussians.count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const float position = gaussians.position_m[3 * i + k];
      to = far ? put(to, origin[k] + double(position)) : put(to, position);
    }
    for (int k = 0; k < 3; ++k) to = put(to, 0.0f);
    const float* colour = &gaussians.sh[3 * size_t(coefficients) * i];
    for (int k = 0; k < 3; ++k) to = put(to, colour[k]);
    for (uint32_t channel = 0; channel < 3; ++channel) {
      for (uint32_t k = 1; k < coefficients; ++k) to = put(to, colour[3 * k + channel]);
    }
    const double opacity = gaussians.opacity[i];
    to = put(to, static_cast<float>(
                     std::clamp(std::log(opacity) - std::log1p(-opacity), -kMaxLogit, kMaxLogit)));
    const ScaleRotation shape = decompose(&gaussians.covariance_factor[9 * i]);
    for (const double scale : shape.scale)
      to = put(to, static_cast<float>(std::max(std::log(scale), kMinLogScale)));
    for (const double value : shape.quaternion) to = put(to, static_cast<float>(value));
  }
  return bytes;
}

}  // namespace figurine::ports
