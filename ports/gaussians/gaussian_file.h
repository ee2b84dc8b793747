// Any file of 3D Gaussians that figurine reads, by what is in it: .ply, compressed .ply, .spz; by
// its name .splat, which has nothing to be known by.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

// The errors of the reader in charge; kUnsupported names what is read if the bytes are none of it.
// kCorrupt if nothing in the file can be drawn, with the reason of the first one left out.
Result<GaussianCloud> read_gaussians(std::span<const std::byte> bytes, const std::string& name);

// Whether a file of this name is worth a try: .ply, .splat, .spz, in any case of letters.
bool is_gaussian_name(const std::string& name);

}  // namespace figurine::ports
