#include "samples/common/loading.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

namespace figurine::samples {

namespace {

// The .fgn files of a folder in the order of their names, so that the same folder always gives the
// same answer. None if it cannot be read.
std::vector<std::string> packages_in(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".fgn" && entry->is_regular_file(error))
      paths.push_back(entry->path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace

Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) return package.status();
  return std::make_unique<LoadedPackage>(
      LoadedPackage{path, std::move(*file), std::move(*package)});
}

Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path, PackageKind wanted) {
  Result<std::unique_ptr<LoadedPackage>> loaded = load_package(path);
  if (loaded.ok() && (*loaded)->package.kind() != wanted) {
    return Status(StatusCode::kInvalidArgument, path + ": kind: is a package of kind " +
                                                    to_string((*loaded)->package.kind()) +
                                                    ", not " + to_string(wanted));
  }
  return loaded;
}

namespace {

// "people.fgn#17" in its parts. A file of the whole name goes first: '#' is no unusual letter in a
// path.
std::pair<std::string, std::optional<std::string>> split_member(const std::string& name) {
  const size_t hash = name.rfind('#');
  std::error_code error;
  if (hash == std::string::npos || std::filesystem::exists(name, error))
    return {name, std::nullopt};
  return {name.substr(0, hash), name.substr(hash + 1)};
}

Status open_population_member(const Population& population, const std::string& path,
                              const std::optional<std::string>& member, LoadedAvatar& out) {
  const std::string count = std::to_string(population.size()),
                    last = std::to_string(population.size() - 1);
  if (!member) {
    return Status(StatusCode::kInvalidArgument, path + ": is a population: name one of its " +
                                                    count + " members, " + path + "#NAME or " +
                                                    path + "#0 to #" + last);
  }
  const std::optional<size_t> index = find_member(population, *member);
  if (!index) {
    return Status(StatusCode::kNotFound, path + ": member '" + *member +
                                             "': there is none of this name, and its " + count +
                                             " members have the numbers 0 to " + last +
                                             " (figurine-inspect lists them)");
  }
  out.storage.resize(member_floats(population));
  out.avatar = open_member(population, *index, out.storage);
  return {};
}

}  // namespace

Result<std::unique_ptr<LoadedAvatar>> load_avatar(const std::string& name) {
  const auto [path, member] = split_member(name);
  Result<std::unique_ptr<LoadedPackage>> package = load_package(path);
  if (!package.ok()) return package.status();
  auto loaded = std::make_unique<LoadedAvatar>(LoadedAvatar{name, std::move(*package), {}, {}});
  const Package& opened = loaded->package->package;
  if (opened.kind() == PackageKind::kPopulation) {
    FIG_RETURN_IF_ERROR(open_population_member(opened.population(), path, member, *loaded));
    return loaded;
  }
  if (member) {
    return Status(StatusCode::kInvalidArgument,
                  path + ": member '" + *member + "': a package of kind " +
                      to_string(opened.kind()) + " has no members, a population has");
  }
  if (opened.kind() == PackageKind::kSampler) {
    return Status(StatusCode::kInvalidArgument,
                  path + ": kind: is a sampler: figurine sample makes an avatar of it");
  }
  if (opened.kind() != PackageKind::kAvatar) {
    return Status(StatusCode::kInvalidArgument, path + ": kind: is a package of kind " +
                                                    to_string(opened.kind()) + ", not avatar");
  }
  loaded->avatar = opened.avatar();
  return loaded;
}

Result<std::unique_ptr<LoadedPackage>> find_body(const LoadedAvatar& avatar,
                                                 const std::string& body_option) {
  return find_body(avatar.avatar, avatar.name, avatar.package->path, body_option);
}

Result<std::unique_ptr<LoadedPackage>> find_body(const Avatar& wanted, const std::string& name,
                                                 const std::string& beside,
                                                 const std::string& body_option) {
  if (!body_option.empty()) {
    Result<std::unique_ptr<LoadedPackage>> body = load_package(body_option, PackageKind::kBody);
    if (!body.ok()) return body;
    const Status fits = check_avatar_fits_body(wanted, (*body)->package);
    if (!fits.ok()) return fits.within(name + " on " + body_option);
    return body;
  }
  const std::filesystem::path folder = std::filesystem::path(beside).parent_path();
  std::vector<std::string> folders = {folder.empty() ? "." : folder.string()};
  if (const char* search = std::getenv("FIGURINE_PATH"); search != nullptr) {
    std::istringstream list(search);
    for (std::string part; std::getline(list, part, ':');) {
      if (!part.empty()) folders.push_back(part);
    }
  }
  std::string others, looked_in;
  for (const std::string& place : folders) {
    looked_in += (looked_in.empty() ? "" : ", ") + place;
    for (const std::string& path : packages_in(place)) {
      Result<std::unique_ptr<LoadedPackage>> candidate = load_package(path);
      if (!candidate.ok() || (*candidate)->package.kind() != PackageKind::kBody) continue;
      if ((*candidate)->package.content_hash() == wanted.body_hash) {
        const Status fits = check_avatar_fits_body(wanted, (*candidate)->package);
        if (!fits.ok()) return fits.within(name + " on " + path);
        return candidate;
      }
      others += (others.empty() ? "" : ", ") + path + " is " +
                format_hash((*candidate)->package.content_hash());
    }
  }
  return Status(others.empty() ? StatusCode::kNotFound : StatusCode::kMismatch,
                name + ": body: needs " + format_hash(wanted.body_hash) + " (" + wanted.body_name +
                    "); looked in " + looked_in +
                    (others.empty() ? "; no body there" : "; found others: " + others));
}

}  // namespace figurine::samples
