// Packages from files: opened by memory map, checked for their kind, avatars also out of
// populations, bodies found for avatars.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "figurine/status.h"
#include "ports/host/files.h"

namespace figurine::samples {

// A package and the map its views point into.
struct LoadedPackage {
  std::string path;
  ports::MappedFile file;
  Package package;
};

// kNotFound, kCorrupt... as the file and the reader say; kInvalidArgument names both kinds if it is
// another one than wanted.
Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path, PackageKind wanted,
                                                    const OpenOptions& options = {});

// Of any kind.
Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path,
                                                    const OpenOptions& options = {});

// An avatar from a package of its own, or a member of a population.
struct LoadedAvatar {
  std::string name;                          // as it was asked for: "person.fgn", "people.fgn#17"
  std::unique_ptr<LoadedPackage> package;    // that it came from; null: it is no file
  std::unique_ptr<LoadedPackage> network;    // that its network came from, if that is another
  std::vector<float> storage;                // of a member's weights
  std::shared_ptr<const void> made_of = {};  // of an avatar that is no file: what it borrows from
  Avatar avatar;                             // points into both
};

// "PATH" of an avatar, or "PATH#MEMBER" of a population, MEMBER a name or a number counted from 0.
// A population is a package, or the folder that it grew in (docs/population.md): its members are
// packages of their own, numbered in the order of their names, and have the network of
// initial/shared.fgn where they come without one. One line says so if the package is of the other
// kind, if there is no such member, or if member and network do not belong together.
Result<std::unique_ptr<LoadedAvatar>> load_avatar(const std::string& name,
                                                  const OpenOptions& options = {});

// The body that an avatar was made for: body_option if given (it must be the right one), else the
// .fgn files beside the avatar, else those of the folders in FIGURINE_PATH (colon-separated), else
// those of the folders beside the avatar's own (samplers/x.fgn stands on populations/y.fgn). Found
// by content hash, whatever the file is called; of other packages that lie there header and index
// alone are read. Without what no command uses (OpenOptions::for_drawing). Errors name the hash
// that is wanted and the hashes that were found.
Result<std::unique_ptr<LoadedPackage>> find_body(const LoadedAvatar& avatar,
                                                 const std::string& body_option);
// The same of an avatar that is no file yet: name is what messages call it, beside the path of what
// it was made from.
Result<std::unique_ptr<LoadedPackage>> find_body(const Avatar& avatar, const std::string& name,
                                                 const std::string& beside,
                                                 const std::string& body_option);

}  // namespace figurine::samples
