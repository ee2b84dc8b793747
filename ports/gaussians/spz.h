// .spz files (Niantic), versions 1 to 4: Gaussians in fixed point, attribute by attribute, packed
// by gzip (1 to 3; or not packed at all) or zstd (4). docs/formats.md has the layout. Based on:
// Niantic Spatial, spz (README, "File Format", and its extensions).
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

// A header that declares more than the file can hold is refused before anything is unpacked:
// kLimitExceeded beyond 1 MiB and 100 times the file's size. kCorrupt for data that end early or
// do not unpack, kUnsupported for other versions, left-handed axes, and all of it in a build
// without FIGURINE_SPZ. Degree 4 is read to degree 3.
Result<GaussianCloud> read_spz(std::span<const std::byte> bytes, const std::string& name);

}  // namespace figurine::ports
