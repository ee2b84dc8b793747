// A package on disk: its bytes and the opened view, kept together.
#pragma once

#include <memory>
#include <string>

#include "figurine/package.h"

namespace figurine::train {

struct PackageFile {
  std::string path;
  std::shared_ptr<const void> bytes;  // what the package points into
  Package package;
};

// Throws InputError "PATH: reason" if it cannot be opened or is of another kind.
PackageFile open_package(const std::string& path, PackageKind kind);

}  // namespace figurine::train
