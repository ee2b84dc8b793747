// A package on disk: its memory map and the opened view, kept together.
#pragma once

#include <string>

#include "figurine/package.h"
#include "ports/host/files.h"

namespace figurine::train {

struct PackageFile {
  std::string path;
  ports::MappedFile bytes;
  Package package;
};

// Throws InputError "PATH: reason" if it cannot be opened or is of another kind.
PackageFile open_package(const std::string& path, PackageKind kind);

}  // namespace figurine::train
