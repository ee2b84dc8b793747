#include "ports/gaussians/gaussian_file.h"

#include <algorithm>
#include <string_view>

#include "ports/gaussians/ply.h"
#include "ports/gaussians/splat.h"
#include "ports/gaussians/spz.h"

namespace figurine::ports {

namespace {

bool has_suffix(const std::string& name, std::string_view suffix) {
  return name.size() >= suffix.size() &&
         std::equal(suffix.begin(), suffix.end(), name.end() - static_cast<long>(suffix.size()),
                    [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b + 32 : b); });
}

Result<GaussianCloud> read_any(std::span<const std::byte> bytes, const std::string& name) {
  const std::string_view start(reinterpret_cast<const char*>(bytes.data()),
                               std::min<size_t>(bytes.size(), 6));
  if (start.starts_with("\x1f\x8b") || start.starts_with("NGSP")) return read_spz(bytes, name);
  if (start.starts_with("ply") || start == "\xEF\xBB\xBFply" || has_suffix(name, ".ply"))
    return read_gaussian_ply(bytes, name);
  if (has_suffix(name, ".splat")) return read_splat(bytes, name);
  return Status(StatusCode::kUnsupported,
                name +
                    ": no file of Gaussians that is read: does not start with 'ply', and is "
                    "neither .spz nor called .splat");
}

}  // namespace

bool is_gaussian_name(const std::string& name) {
  return has_suffix(name, ".ply") || has_suffix(name, ".splat") || has_suffix(name, ".spz");
}

Result<GaussianCloud> read_gaussians(std::span<const std::byte> bytes, const std::string& name) {
  Result<GaussianCloud> cloud = read_any(bytes, name);
  if (!cloud.ok() || cloud->count() > 0) return cloud;
  return Status(StatusCode::kCorrupt,
                name + ": " + cloud->container + ": holds no Gaussian that can be drawn" +
                    (cloud->left_out > 0 ? " (" + std::to_string(cloud->left_out) +
                                               " left out, the first: " + cloud->left_out_why + ")"
                                         : ""));
}

}  // namespace figurine::ports
