// A population on disk: a package, or the folder of members that it grew in.
#pragma once

#include <string>

#include "toolchain/train/package_file.h"

namespace figurine::train {

// path: a population package, or a folder (docs/population.md) with members/*.fgn, split.json and,
// where all members share a network, initial/shared.fgn, whose members are packed for as long as
// the result lives. All quality figures and parts of the split are then those of the members that
// are there; members of split.json that are not there yet are no error. Throws InputError "PATH:
// reason".
PackageFile open_population(const std::string& path);

}  // namespace figurine::train
