#include "ports/gaussians/splat.h"

#include <cstring>
#include <limits>
#include <utility>

#include "ports/gaussians/cloud_builder.h"

namespace figurine::ports {

namespace {

constexpr size_t kRecordBytes = 32;

StoredGaussian gaussian_of(const std::byte* record) {
  float floats[6];
  uint8_t bytes[8];
  std::memcpy(floats, record, sizeof(floats));
  std::memcpy(bytes, record + sizeof(floats), sizeof(bytes));
  StoredGaussian gaussian;
  for (size_t k = 0; k < 3; ++k) {
    gaussian.position_m[k] = floats[k];
    gaussian.scale_m[k] = floats[3 + k];
    gaussian.sh[k] = (bytes[k] / 255.0 - double(kShOffset)) / double(kSh0);
  }
  gaussian.opacity = bytes[3] / 255.0;
  for (size_t k = 0; k < 4; ++k) gaussian.rotation[k] = bytes[4 + k] - 128.0;
  return gaussian;
}

}  // namespace

Result<GaussianCloud> read_splat(std::span<const std::byte> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Status(StatusCode::kCorrupt, name + ": splat: " + what);
  };
  const size_t count = bytes.size() / kRecordBytes;
  if (bytes.size() % kRecordBytes != 0) {
    return corrupt(std::to_string(bytes.size()) + " bytes are no multiple of 32: cut after " +
                   std::to_string(count) + " Gaussians, or another kind of file");
  }
  if (count > std::numeric_limits<uint32_t>::max()) return corrupt("more than 2^32 Gaussians");
  CloudBuilder builder("splat", 0, count);
  for (size_t i = 0; i < count; ++i) builder.add(i, gaussian_of(bytes.data() + i * kRecordBytes));
  GaussianCloud cloud = std::move(builder).finish();
  if (cloud.count() == 0 && count > 0)
    return corrupt("no record is a Gaussian (" + cloud.left_out_why + ")");
  return cloud;
}

}  // namespace figurine::ports
