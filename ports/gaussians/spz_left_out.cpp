// In place of spz.cpp in a build without FIGURINE_SPZ: such files are known and refused.
#include "ports/gaussians/spz.h"

namespace figurine::ports {

Result<GaussianCloud> read_spz(std::span<const std::byte>, const std::string& name) {
  return Status(StatusCode::kUnsupported, name + ": spz: not read in this build (FIGURINE_SPZ)");
}

}  // namespace figurine::ports
