// Packages from files: opened by memory map, checked for their kind, bodies found for avatars.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "figurine/status.h"
#include "ports/linux/files.h"

namespace figurine::samples {

// A package and the map its views point into.
struct LoadedPackage {
  std::string path;
  ports::MappedFile file;
  Package package;
};

// kNotFound, kCorrupt... as the file and the reader say; kInvalidArgument names both kinds if it is another one than wanted.
Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path, PackageKind wanted);

// The body that an avatar was made for: body_option if given (it must be the right one), else the .fgn files beside the avatar, else those
// of the folders in FIGURINE_PATH (colon-separated). Found by content hash, whatever the file is called. Errors name the hash that is
// wanted and the hashes that were found.
Result<std::unique_ptr<LoadedPackage>> find_body(const LoadedPackage& avatar, const std::string& body_option);

}  // namespace figurine::samples
