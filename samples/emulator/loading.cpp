#include "samples/emulator/loading.h"

#include <algorithm>
#include <filesystem>

#include "samples/common/gaussian_scene.h"

namespace figurine::emulator {

namespace {

constexpr std::byte kPackageBegins{0x8F};  // no text and no file of Gaussians begins so

// Of an avatar; known: that need not be looked for.
Result<std::shared_ptr<samples::LoadedPackage>> body_of(
    const samples::LoadedAvatar& avatar,
    const std::vector<std::shared_ptr<samples::LoadedPackage>>& known) {
  for (const std::shared_ptr<samples::LoadedPackage>& body : known) {
    if (body->package.content_hash() != avatar.avatar.body_hash) continue;
    FIG_RETURN_IF_ERROR(check_avatar_fits_body(avatar.avatar, body->package).within(avatar.name));
    return body;
  }
  Result<std::unique_ptr<samples::LoadedPackage>> body = samples::find_body(avatar, "");
  if (!body.ok()) return body.status();
  return std::shared_ptr<samples::LoadedPackage>(std::move(*body));
}

Status load_coarse(const std::string& path, const LoadWish& wish, Loaded& loaded) {
  Result<std::unique_ptr<samples::LoadedAvatar>> avatar = samples::load_avatar(path);
  if (!avatar.ok()) return avatar.status();
  const Result<std::shared_ptr<samples::LoadedPackage>> body = body_of(**avatar, wish.bodies);
  if (!body.ok()) return body.status();
  loaded.coarse = {std::move(*avatar), *body};
  return {};
}

Status load_avatar_with_body(const LoadWish& wish, Loaded& loaded) {
  Result<std::unique_ptr<samples::LoadedAvatar>> avatar = samples::load_avatar(wish.path);
  if (!avatar.ok()) return avatar.status();
  loaded.avatar = std::move(*avatar);
  const Result<std::shared_ptr<samples::LoadedPackage>> body = body_of(*loaded.avatar, wish.bodies);
  if (!body.ok()) return body.status();
  loaded.body = *body;
  const std::string coarse = coarse_name(wish.path);
  std::error_code error;
  if (!coarse.empty() && std::filesystem::exists(coarse, error))
    loaded.coarse_trouble = load_coarse(coarse, wish, loaded);
  return {};
}

Status load_sampler(std::unique_ptr<samples::LoadedPackage> package, Loaded& loaded) {
  loaded.sampler = std::make_shared<LoadedSampler>();
  loaded.sampler->package = std::move(package);
  Result<std::unique_ptr<AvatarSampler>> sampler =
      AvatarSampler::create(loaded.sampler->package->package.sampler());
  if (!sampler.ok()) return sampler.status().within(loaded.path);
  loaded.sampler->sampler = std::move(*sampler);
  return {};
}

}  // namespace

std::string coarse_name(const std::string& path) {
  constexpr std::string_view kEnding = ".fgn";
  if (!path.ends_with(kEnding)) return "";
  return path.substr(0, path.size() - kEnding.size()) + "-coarse.fgn";
}

Result<Loaded> load_file(const LoadWish& wish) {
  Loaded loaded{.path = wish.path};
  std::error_code error;
  if (wish.path.find('#') != std::string::npos && !std::filesystem::exists(wish.path, error)) {
    FIG_RETURN_IF_ERROR(load_avatar_with_body(wish, loaded));  // of a population
    return loaded;
  }
  bool package = false;
  {
    const Result<ports::MappedFile> file = ports::MappedFile::open(wish.path);
    if (!file.ok()) return file.status();
    package = !file->bytes().empty() && file->bytes().front() == kPackageBegins;
  }
  if (!package) {
    Result<ports::GaussianCloud> cloud = samples::read_scene(wish.path);
    if (!cloud.ok()) return cloud.status();
    loaded.cloud = std::make_shared<ports::GaussianCloud>(std::move(*cloud));
    return loaded;
  }
  Result<std::unique_ptr<samples::LoadedPackage>> opened = samples::load_package(wish.path);
  if (!opened.ok()) return opened.status();
  switch ((*opened)->package.kind()) {
    case PackageKind::kMotion:
      loaded.motion = std::move(*opened);
      return loaded;
    case PackageKind::kBody:
      loaded.body = std::move(*opened);
      return loaded;
    case PackageKind::kSampler:
      FIG_RETURN_IF_ERROR(load_sampler(std::move(*opened), loaded));
      return loaded;
    default:
      FIG_RETURN_IF_ERROR(load_avatar_with_body(wish, loaded));  // or why it is none
      return loaded;
  }
}

}  // namespace figurine::emulator
