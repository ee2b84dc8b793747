// The words of a GaussianCloud.
#include "ports/gaussians/gaussian_cloud.h"

#include <cstdio>

namespace figurine::ports {

const char* to_string(UpAxis axis) {
  constexpr const char* kNames[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[static_cast<size_t>(axis)];
}

std::optional<UpAxis> parse_up_axis(const std::string& text) {
  for (const UpAxis axis : {UpAxis::kPlusX, UpAxis::kMinusX, UpAxis::kPlusY, UpAxis::kMinusY,
                            UpAxis::kPlusZ, UpAxis::kMinusZ}) {
    if (text == to_string(axis)) return axis;
  }
  return std::nullopt;
}

std::string describe(const GaussianCloud& cloud) {
  std::string text = std::to_string(cloud.count()) + " Gaussians of degree " +
                     std::to_string(cloud.sh_degree) + " (" + cloud.container + ")";
  if (cloud.left_out > 0)
    text += ", left out " + std::to_string(cloud.left_out) + " (" + cloud.left_out_why + ")";
  const auto& origin = cloud.origin_m;
  if (origin[0] != 0 || origin[1] != 0 || origin[2] != 0) {
    char numbers[160];
    std::snprintf(numbers, sizeof(numbers), ", origin %.17g %.17g %.17g", origin[0], origin[1],
                  origin[2]);
    text += numbers;
  }
  if (cloud.antialiased) text += ", antialiased";
  text += std::string(", up ") + to_string(cloud.up_axis()) + (cloud.up ? "" : " (assumed)");
  for (const std::string& remark : cloud.remarks) text += "; " + remark;
  return text;
}

}  // namespace figurine::ports
