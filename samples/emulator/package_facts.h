// What a package says of itself, as lines for a panel: the part of what figurine-inspect prints
// that fits beside a picture.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "ports/gaussians/gaussian_cloud.h"
#include "samples/common/loading.h"

namespace figurine::emulator {

struct PackageFacts {
  using Line = std::pair<std::string, std::string>;
  std::string title;
  std::vector<Line> lines;
  std::vector<Line> quality;  // as measured by who made it; empty: not stated
};

PackageFacts facts_of(const samples::LoadedAvatar& avatar, const samples::LoadedPackage& body);
PackageFacts facts_of(const std::string& path, const ports::GaussianCloud& cloud);

std::string bytes_text(uint64_t bytes);  // "312 kB", "2.7 MB"

}  // namespace figurine::emulator
