// Any bytes into the readers of Gaussians: each refuses them in one line, or returns arrays that
// belong together and can be drawn. By their first bytes as .ply, plain or compressed, or .spz, and
// all of them as .splat. tests/fuzz/seeds/gaussians is the seed corpus; the .spz in it that are not
// packed let a fuzzer reach what gzip's checksum would hide.
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "ports/gaussians/gaussian_file.h"

namespace {

void check(bool sound) {
  if (!sound) std::abort();
}

void read_and_use(std::span<const std::byte> bytes, const char* name) {
  const figurine::Result<figurine::ports::GaussianCloud> cloud =
      figurine::ports::read_gaussians(bytes, name);
  if (!cloud.ok()) {
    check(cloud.status().message().starts_with(name));
    check(cloud.status().message().find('\n') == std::string::npos);
    return;
  }
  const size_t count = cloud->count();
  check(count > 0 && count <= 100 * bytes.size() + (1 << 20));
  check(cloud->sh_degree <= figurine::kMaxShDegree);
  check(cloud->position_m.size() == 3 * count && cloud->covariance_factor.size() == 9 * count);
  check(cloud->sh.size() == 3 * figurine::sh_coefficients(cloud->sh_degree) * count);
  for (const auto* values : {&cloud->position_m, &cloud->covariance_factor, &cloud->sh}) {
    for (const float value : *values) check(std::isfinite(value));
  }
  for (const float opacity : cloud->opacity) check(opacity >= 0 && opacity <= 1);
  for (const double origin : cloud->origin_m) check(std::isfinite(origin));
  check(figurine::ports::describe(*cloud).find('\n') == std::string::npos);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  read_and_use(bytes, "fuzz.ply");
  read_and_use(bytes.first(size - size % 32), "fuzz.splat");
  return 0;
}
