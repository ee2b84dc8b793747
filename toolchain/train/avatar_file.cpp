#include "toolchain/train/avatar_file.h"

#include <filesystem>
#include <optional>

#include "toolchain/error.h"
#include "toolchain/train/population_file.h"

namespace figurine::train {

AvatarFile open_avatar(const std::string& name) {
  const size_t hash = name.rfind('#');
  if (hash == std::string::npos || std::filesystem::exists(name)) {
    AvatarFile opened{open_package(name, PackageKind::kAvatar), {}, {}};
    opened.avatar = opened.file.package.avatar();
    return opened;
  }
  AvatarFile opened{open_population(name.substr(0, hash)), {}, {}};
  const Population& population = opened.file.package.population();
  const std::optional<size_t> member = find_member(population, name.substr(hash + 1));
  if (!member)
    throw InputError(opened.file.path + ": member '" + name.substr(hash + 1) +
                     "': there is none of this name or number");
  opened.storage.resize(member_floats(population));
  opened.avatar = open_member(population, *member, opened.storage);
  return opened;
}

}  // namespace figurine::train
