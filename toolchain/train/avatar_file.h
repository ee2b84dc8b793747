// An avatar on disk: a package of its own, or a member of a population ("people.fgn#NAME",
// "people.fgn#17").
#pragma once

#include <string>
#include <vector>

#include "toolchain/train/package_file.h"

namespace figurine::train {

struct AvatarFile {
  PackageFile file;
  std::vector<float> storage;  // of a member's weights
  Avatar avatar;               // points into both
};

// Throws InputError "PATH: reason" if there is no such package or member.
AvatarFile open_avatar(const std::string& name);

}  // namespace figurine::train
