// What the fuzzers of Gaussians share: a reader refuses any bytes in one line, or returns arrays
// that belong together and can be drawn.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "ports/gaussians/gaussian_file.h"

namespace figurine::ports::tests {

inline void check(bool sound) {
  if (!sound) std::abort();
}

// name: by its end the reader of .splat is chosen; the others by the bytes.
inline void read_and_use(std::span<const std::byte> bytes, const char* name) {
  const Result<GaussianCloud> cloud = read_gaussians(bytes, name);
  if (!cloud.ok()) {
    check(cloud.status().message().starts_with(name));
    check(cloud.status().message().find('\n') == std::string::npos);
    return;
  }
  const size_t count = cloud->count();
  check(count > 0 && count <= 100 * bytes.size() + (1 << 20));
  check(cloud->sh_degree <= kMaxShDegree);
  check(cloud->position_m.size() == 3 * count && cloud->covariance_factor.size() == 9 * count);
  check(cloud->sh.size() == 3 * sh_coefficients(cloud->sh_degree) * count);
  for (const auto* values : {&cloud->position_m, &cloud->covariance_factor, &cloud->sh}) {
    for (const float value : *values) check(std::isfinite(value));
  }
  for (const float opacity : cloud->opacity) check(opacity >= 0 && opacity <= 1);
  for (const double origin : cloud->origin_m) check(std::isfinite(origin));
  check(describe(*cloud).find('\n') == std::string::npos);
}

inline std::span<const std::byte> bytes_of(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const std::byte*>(data), size};
}

}  // namespace figurine::ports::tests
