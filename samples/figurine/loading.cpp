#include "samples/figurine/loading.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <system_error>

namespace figurine::samples {

namespace {

// The .fgn files of a folder in the order of their names, so that the same folder always gives the same answer. None if it cannot be read.
std::vector<std::string> packages_in(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == ".fgn" && entry->is_regular_file(error)) paths.push_back(entry->path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

Result<std::unique_ptr<LoadedPackage>> open_any(const std::string& path) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) return package.status();
  return std::make_unique<LoadedPackage>(LoadedPackage{path, std::move(*file), std::move(*package)});
}

}  // namespace

Result<std::unique_ptr<LoadedPackage>> load_package(const std::string& path, PackageKind wanted) {
  Result<std::unique_ptr<LoadedPackage>> loaded = open_any(path);
  if (loaded.ok() && (*loaded)->package.kind() != wanted) {
    return Status(StatusCode::kInvalidArgument,
                  path + ": kind: is a package of kind " + to_string((*loaded)->package.kind()) + ", not " + to_string(wanted));
  }
  return loaded;
}

Result<std::unique_ptr<LoadedPackage>> find_body(const LoadedPackage& avatar, const std::string& body_option) {
  const Avatar& wanted = avatar.package.avatar();
  if (!body_option.empty()) {
    Result<std::unique_ptr<LoadedPackage>> body = load_package(body_option, PackageKind::kBody);
    if (!body.ok()) return body;
    const Status fits = check_avatar_fits_body(wanted, (*body)->package);
    if (!fits.ok()) return fits.within(avatar.path + " on " + body_option);
    return body;
  }
  const std::filesystem::path folder = std::filesystem::path(avatar.path).parent_path();
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
      Result<std::unique_ptr<LoadedPackage>> candidate = open_any(path);
      if (!candidate.ok() || (*candidate)->package.kind() != PackageKind::kBody) continue;
      if ((*candidate)->package.content_hash() == wanted.body_hash) {
        const Status fits = check_avatar_fits_body(wanted, (*candidate)->package);
        if (!fits.ok()) return fits.within(avatar.path + " on " + path);
        return candidate;
      }
      others += (others.empty() ? "" : ", ") + path + " is " + format_hash((*candidate)->package.content_hash());
    }
  }
  return Status(others.empty() ? StatusCode::kNotFound : StatusCode::kMismatch,
                avatar.path + ": body: needs " + format_hash(wanted.body_hash) + " (" + wanted.body_name + "); looked in " + looked_in +
                    (others.empty() ? "; no body there" : "; found others: " + others));
}

}  // namespace figurine::samples
