#include "toolchain/train/population_file.h"

#include <filesystem>
#include <memory>
#include <utility>

#include "formats/writer/package_writer.h"
#include "toolchain/error.h"
#include "toolchain/train/pack_population.h"

namespace figurine::train {

namespace {

namespace fs = std::filesystem;

// Of the folder that a population grew in: toolchain/population/state.h.
constexpr const char* kMembers = "members";
constexpr const char* kSplit = "split.json";
constexpr const char* kSharedNetwork = "initial/shared.fgn";
constexpr const char* kInitialWeights = "initial/weights.safetensors";

std::string if_there(const fs::path& path) { return fs::exists(path) ? path.string() : ""; }

}  // namespace

PackageFile open_population(const std::string& path) {
  if (!fs::is_directory(path)) return open_package(path, PackageKind::kPopulation);
  const fs::path folder(path);
  if (!fs::is_directory(folder / kMembers))
    throw InputError(path + ": is a folder without " + kMembers + "/, so no population's");
  PackPopulationOptions options{.inputs = {(folder / kMembers).string()},
                                .name = fs::absolute(folder / "").parent_path().filename(),
                                .shared = if_there(folder / kSharedNetwork),
                                .split = if_there(folder / kSplit),
                                .say_how = false,
                                .quiet = true};
  if (options.shared.empty()) options.init = if_there(folder / kInitialWeights);
  auto bytes = std::make_shared<AlignedBytes>(pack_population(options));
  Package package = value_or_throw(Package::open(bytes->bytes(), path), path);
  return {path, std::move(bytes), std::move(package)};
}

}  // namespace figurine::train
