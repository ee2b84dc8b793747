#include "toolchain/train/package_file.h"

#include <utility>

#include "ports/host/files.h"
#include "toolchain/error.h"

namespace figurine::train {

PackageFile open_package(const std::string& path, PackageKind kind) {
  Result<ports::MappedFile> bytes = ports::MappedFile::open(path);
  if (!bytes.ok()) throw InputError(bytes.status().message());
  Result<Package> package = Package::open(bytes->bytes(), path);
  if (!package.ok()) throw InputError(package.status().message());
  if (package->kind() != kind)
    throw InputError(path + ": is a package of kind " + to_string(package->kind()) + ", not " +
                     to_string(kind));
  return {path, std::make_shared<ports::MappedFile>(std::move(bytes).value()),
          std::move(package).value()};
}

}  // namespace figurine::train
