#include "samples/common/loading.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

namespace figurine::samples {

namespace {

// Of the folder that a population grew in (docs/population.md).
constexpr const char* kMembersFolder = "members";
constexpr const char* kSharedNetwork = "initial/shared.fgn";

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

// The folders beside a folder, itself not among them, that hold packages; in the order of their
// names. None if the folder above cannot be read.
std::vector<std::string> siblings_of(const std::filesystem::path& folder) {
  std::vector<std::string> siblings;
  std::error_code error;
  const std::filesystem::path above = (folder / "..").lexically_normal();
  for (std::filesystem::directory_iterator entry(above, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unreadable;
    if (!entry->is_directory(unreadable) ||
        std::filesystem::equivalent(entry->path(), folder, unreadable))
      continue;
    if (!packages_in(entry->path().string()).empty()) siblings.push_back(entry->path().string());
  }
  std::sort(siblings.begin(), siblings.end());
  return siblings;
}

// The package's own folder and, for a member, its population's; then those of FIGURINE_PATH.
std::vector<std::string> first_body_folders(const std::filesystem::path& own) {
  std::vector<std::string> folders = {own.string()};
  if (own.filename() == kMembersFolder) folders.push_back((own / "..").lexically_normal().string());
  if (const char* search = std::getenv("FIGURINE_PATH"); search != nullptr) {
    std::istringstream list(search);
    for (std::string part; std::getline(list, part, ':');) {
      if (!part.empty()) folders.push_back(part);
    }
  }
  return folders;
}

}  // namespace

Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path,
                                                    const OpenOptions& options) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<Package> package = Package::open(file->bytes(), path, options);
  if (!package.ok()) return package.status();
  return std::make_unique<LoadedPackage>(
      LoadedPackage{path, std::move(*file), std::move(*package)});
}

Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path, PackageKind wanted,
                                                    const OpenOptions& options) {
  Result<std::unique_ptr<LoadedPackage>> loaded = load_package(path, options);
  if (loaded.ok() && (*loaded)->package.kind() != wanted) {
    return Status(StatusCode::kInvalidArgument, path + ": kind: is a package of kind " +
                                                    to_string((*loaded)->package.kind()) +
                                                    ", not " + to_string(wanted));
  }
  return loaded;
}

namespace {

Status no_such_member(const std::string& path, const std::string& member, size_t count,
                      const std::string& list = "figurine-inspect lists them") {
  return Status(StatusCode::kNotFound,
                path + ": member '" + member + "': there is none of this name, and its " +
                    std::to_string(count) + " members have the numbers 0 to " +
                    std::to_string(count - 1) + " (" + list + ")");
}

Status names_no_member(const std::string& path, size_t count) {
  return Status(StatusCode::kInvalidArgument, path + ": is a population: name one of its " +
                                                  std::to_string(count) + " members, " + path +
                                                  "#NAME or " + path + "#0 to #" +
                                                  std::to_string(count - 1));
}

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
  if (!member) return names_no_member(path, population.size());
  const std::optional<size_t> index = find_member(population, *member);
  if (!index) return no_such_member(path, *member, population.size());
  out.storage.resize(member_floats(population));
  out.avatar = open_member(population, *index, out.storage);
  return {};
}

// By its name, or if none is called so by its number, counted from 0.
std::optional<std::string> find_member_file(const std::vector<std::string>& paths,
                                            const std::string& member) {
  for (const std::string& path : paths) {
    if (std::filesystem::path(path).stem() == member) return path;
  }
  size_t number = 0;
  const char* const end = member.data() + member.size();
  const auto parsed = std::from_chars(member.data(), end, number);
  if (parsed.ec != std::errc{} || parsed.ptr != end || number >= paths.size()) return std::nullopt;
  return paths[number];
}

// A member that is a map alone gets the network that all members share, and what belongs to it.
Status take_shared_network(const std::string& folder, const OpenOptions& options,
                           LoadedAvatar& member) {
  Result<std::unique_ptr<LoadedPackage>> shared = load_package(
      (std::filesystem::path(folder) / kSharedNetwork).string(), PackageKind::kAvatar, options);
  if (!shared.ok()) return shared.status();
  const Avatar& from = (*shared)->package.avatar();
  Avatar& to = member.avatar;
  const auto differs = [&](const std::string& field) {
    return Status(StatusCode::kMismatch, member.package->path + ": " + field + ": is not that of " +
                                             (*shared)->path + ", whose network it lacks");
  };
  if (!from.has_network())
    return Status(StatusCode::kInvalidArgument, (*shared)->path + ": has no network to share");
  if (to.body_hash != from.body_hash) return differs("body");
  if (to.texels_a_side() != from.texels_a_side()) return differs("uv_size");
  if (to.template_mode != from.template_mode) return differs("template");
  if (to.antialiased != from.antialiased) return differs("antialiased");
  to.uv_size = to.texels_a_side();
  to.kind() = from.kind();
  to.map_statistics = from.map_statistics;
  to.fixed_point = from.fixed_point;
  to.pose_statistics = from.pose_statistics;
  member.network = std::move(*shared);
  return {};
}

Result<std::unique_ptr<LoadedAvatar>> load_from_folder(const std::string& name,
                                                       const std::string& folder,
                                                       const std::optional<std::string>& member,
                                                       const OpenOptions& options) {
  const std::vector<std::string> paths =
      packages_in((std::filesystem::path(folder) / kMembersFolder).string());
  if (paths.empty()) {
    return Status(StatusCode::kNotFound, folder + ": is a folder, and no package is in its " +
                                             std::string(kMembersFolder) + "/");
  }
  if (!member) return names_no_member(folder, paths.size());
  const std::optional<std::string> path = find_member_file(paths, *member);
  if (!path) return no_such_member(folder, *member, paths.size(), "its folder members/ holds them");
  Result<std::unique_ptr<LoadedPackage>> package =
      load_package(*path, PackageKind::kAvatar, options);
  if (!package.ok()) return package.status();
  auto loaded =
      std::make_unique<LoadedAvatar>(LoadedAvatar{name, std::move(*package), {}, {}, {}, {}});
  loaded->avatar = loaded->package->package.avatar();
  if (!loaded->avatar.has_network())
    FIG_RETURN_IF_ERROR(take_shared_network(folder, options, *loaded));
  return loaded;
}

bool is_folder(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

}  // namespace

Result<std::unique_ptr<LoadedAvatar>> load_avatar(const std::string& name,
                                                  const OpenOptions& options) {
  const auto [path, member] = split_member(name);
  if (is_folder(path)) return load_from_folder(name, path, member, options);
  Result<std::unique_ptr<LoadedPackage>> package = load_package(path, options);
  if (!package.ok()) return package.status();
  auto loaded =
      std::make_unique<LoadedAvatar>(LoadedAvatar{name, std::move(*package), {}, {}, {}, {}});
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

namespace {

// Of a file that is a body's package by its header and index; none of another.
std::optional<std::array<uint64_t, 2>> body_hash(const std::string& path) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return std::nullopt;
  const Result<PackageIdentity> identity = Package::identify(file->bytes(), path);
  if (!identity.ok() || identity->kind != PackageKind::kBody) return std::nullopt;
  return identity->content_hash;
}

// A search for one body, and what it has met: for the message if it fails.
struct BodySearch {
  const Avatar& wanted;
  std::string looked_in, others;

  // Null if the body is not among the folder's packages.
  std::unique_ptr<LoadedPackage> look_in(const std::string& folder) {
    looked_in += (looked_in.empty() ? "" : ", ") + folder;
    for (const std::string& path : packages_in(folder)) {
      const std::optional<std::array<uint64_t, 2>> hash = body_hash(path);
      if (!hash) continue;
      if (*hash == wanted.body_hash) {
        Result<std::unique_ptr<LoadedPackage>> body =
            load_package(path, OpenOptions::for_drawing());
        if (body.ok()) return std::move(*body);
        continue;
      }
      others += (others.empty() ? "" : ", ") + path + " is " + format_hash(*hash);
    }
    return nullptr;
  }
};

}  // namespace

Result<std::unique_ptr<LoadedPackage>> find_body(const Avatar& wanted, const std::string& name,
                                                 const std::string& beside,
                                                 const std::string& body_option) {
  const auto checked = [&](std::unique_ptr<LoadedPackage> body) {
    const Status fits = check_avatar_fits_body(wanted, body->package);
    return fits.ok() ? Result(std::move(body)) : fits.within(name + " on " + body->path);
  };
  if (!body_option.empty()) {
    Result<std::unique_ptr<LoadedPackage>> body =
        load_package(body_option, PackageKind::kBody, OpenOptions::for_drawing());
    return body.ok() ? checked(std::move(*body)) : std::move(body);
  }
  std::filesystem::path own = std::filesystem::path(beside).parent_path();
  if (own.empty()) own = ".";
  BodySearch search{wanted, {}, {}};
  for (const std::string& folder : first_body_folders(own)) {
    if (std::unique_ptr<LoadedPackage> body = search.look_in(folder))
      return checked(std::move(body));
  }
  for (const std::string& folder : siblings_of(own)) {
    if (std::unique_ptr<LoadedPackage> body = search.look_in(folder))
      return checked(std::move(body));
  }
  const bool none = search.others.empty();
  return Status(none ? StatusCode::kNotFound : StatusCode::kMismatch,
                name + ": body: needs " + format_hash(wanted.body_hash) + " (" + wanted.body_name +
                    "); looked in " + search.looked_in +
                    (none ? "; no body there" : "; found others: " + search.others));
}

}  // namespace figurine::samples
