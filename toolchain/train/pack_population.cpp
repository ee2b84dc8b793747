#include "toolchain/train/pack_population.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "formats/writer/package_writer.h"
#include "toolchain/error.h"
#include "toolchain/model/unet.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/progress.h"

namespace figurine::train {

namespace {

namespace fs = std::filesystem;

// An opened avatar package: mapped from a file, or packed from a run just now.
struct Source {
  std::string path;
  std::unique_ptr<PackageFile> file;
  std::unique_ptr<AlignedBytes> packed;
  std::optional<Package> own;  // of packed

  const Package& package() const { return file ? file->package : *own; }
};

Source open_file(const std::string& path) {
  return {path, std::make_unique<PackageFile>(open_package(path, PackageKind::kAvatar)), nullptr,
          std::nullopt};
}

Source pack_run(const std::string& path, uint32_t threads) {
  TrainedAvatar avatar =
      TrainedAvatar::open({.run = path, .data = {}, .body = {}, .threads = threads});
  PackOptions options;
  options.golden = false;  // the picture; a population has none
  auto bytes = std::make_unique<AlignedBytes>(pack_avatar(avatar, RunDirectory{path}, options));
  Package package = value_or_throw(Package::open(bytes->bytes(), path), path);
  return {path, nullptr, std::move(bytes), std::move(package)};
}

// Avatar packages below a folder. Packages of other kinds may lie among them; one that cannot be
// read is an error, or a member would be missing without a word.
std::vector<std::string> avatars_below(const std::string& folder) {
  std::vector<std::string> candidates, avatars;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().extension() == ".fgn")
      candidates.push_back(entry.path().string());
  }
  std::sort(candidates.begin(), candidates.end());
  for (const std::string& path : candidates) {
    const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path), folder);
    if (value_or_throw(Package::open(file.bytes(), path), folder).kind() == PackageKind::kAvatar)
      avatars.push_back(path);
  }
  if (avatars.empty()) throw InputError(folder + ": has no avatar package below it, and is no run");
  return avatars;
}

std::vector<Source> open_all(const PackPopulationOptions& options, Progress& progress,
                             const InterruptGuard& interrupt) {
  std::vector<Source> sources;
  for (size_t i = 0; i < options.inputs.size(); ++i) {
    const std::string& input = options.inputs[i];
    progress.show(0.5 * static_cast<double>(i) / static_cast<double>(options.inputs.size()), input);
    if (interrupt.requested()) throw Interrupted("population: interrupted, nothing was written");
    if (!fs::is_directory(input)) {
      sources.push_back(open_file(input));
    } else if (fs::exists(RunDirectory{input}.run_json())) {
      sources.push_back(pack_run(input, options.threads));
    } else {
      for (const std::string& path : avatars_below(input)) sources.push_back(open_file(path));
    }
  }
  std::map<std::string, std::string> seen;
  for (const Source& source : sources) {
    const auto [other, is_new] = seen.emplace(source.package().avatar().name, source.path);
    if (!is_new)
      throw InputError(source.path + ": member '" + other->first + "' is there twice, " +
                       other->second + " is called so too");
  }
  return sources;
}

// The weights that all members started from, in the shape of `shape`.
Network initial_weights(const Network& shape, const std::string& init,
                        std::vector<float>& storage) {
  model::PoseUNet unet(shape,
                       {.precision = model::Precision::kFloat32, .seed = kInitialWeightsSeed});
  if (!init.empty()) load_weights(init, unet);
  return unet.export_network(storage);
}

figurine::Budget largest(const figurine::Budget& a, const figurine::Budget& b) {
  return {.peak_memory_bytes = std::max(a.peak_memory_bytes, b.peak_memory_bytes),
          .macs_per_frame = std::max(a.macs_per_frame, b.macs_per_frame),
          .gaussians = std::max(a.gaussians, b.gaussians)};
}

std::string name_of(const nlohmann::json& entry, const std::string& path) {
  if (entry.is_string()) return entry.get<std::string>();
  if (!entry.is_number_unsigned())
    throw InputError(path + ": an identity is neither a name nor a whole number");
  char digits[32];  // as captures name their folders
  std::snprintf(digits, sizeof(digits), "%06llu",
                static_cast<unsigned long long>(entry.get<uint64_t>()));
  return digits;
}

}  // namespace

std::map<std::string, Split> read_split(const std::string& path) {
  const nlohmann::json json = read_json(path);
  std::map<std::string, Split> split;
  for (const Split part : {Split::kTrain, Split::kValidation, Split::kTest}) {
    const auto list = json.find(to_string(part));
    if (list == json.end() || !list->is_array())
      throw InputError(path + ": " + to_string(part) + ": is not a list of identities");
    for (const nlohmann::json& entry : *list) {
      const std::string name = name_of(entry, path);
      if (!split.emplace(name, part).second)
        throw InputError(path + ": '" + name + "' is there twice");
    }
  }
  return split;
}

std::vector<std::byte> pack_population(const PackPopulationOptions& options) {
  const InterruptGuard interrupt;
  Progress progress("population", options.quiet);
  std::map<std::string, Split> split;
  if (!options.split.empty()) split = read_split(options.split);
  const std::vector<Source> sources = open_all(options, progress, interrupt);
  std::unique_ptr<PackageFile> shared;
  if (!options.shared.empty())
    shared = std::make_unique<PackageFile>(open_package(options.shared, PackageKind::kAvatar));
  const Avatar& first = sources.front().package().avatar();
  std::vector<float> storage;
  NewPopulation population{
      .name = options.name, .coding = options.coding, .levels = options.levels};
  if (shared) {
    const Avatar& avatar = shared->package.avatar();
    if (!avatar.has_network() || !avatar.holds(Precision::kFloat32))
      throw InputError(options.shared + ": has no network in floats for the members to share");
    population.initial = avatar.network;
    population.shared = &avatar;
    population.coding = DifferenceCoding::kNone;
  } else {
    population.initial = initial_weights(first.network, options.init, storage);
  }
  for (const Source& source : sources) {
    const Package& package = source.package();
    NewMember& member = population.members.emplace_back(
        NewMember{.avatar = &package.avatar(), .provenance = &package.provenance()});
    if (!split.empty()) {
      const auto part = split.find(member.avatar->name);
      if (part == split.end())
        throw InputError(source.path + ": member '" + member.avatar->name + "' is in no part of " +
                         options.split);
      member.split = part->second;
    }
    population.budget = largest(population.budget, package.budget());
  }
  population.settings = {{"population.levels", std::to_string(options.levels)}};
  if (options.say_how) {
    population.settings.insert(
        population.settings.begin(),
        {{"population.command", current_command()}, {"population.commit", current_commit()}});
    population.settings.push_back(
        {"population.init", !options.shared.empty() ? options.shared
                            : options.init.empty()  ? "seed " + std::to_string(kInitialWeightsSeed)
                                                    : options.init});
  }
  population.progress = [&](size_t done) {
    progress.show(0.5 + 0.5 * static_cast<double>(done) / static_cast<double>(sources.size()),
                  std::to_string(done) + " members");
    return !interrupt.requested();
  };
  Result<std::vector<std::byte>> bytes = write_population(population);
  if (!bytes.ok() && bytes.status().code() == StatusCode::kInterrupted)
    throw Interrupted(bytes.status().message());
  return value_or_throw(std::move(bytes), "population");
}

}  // namespace figurine::train
