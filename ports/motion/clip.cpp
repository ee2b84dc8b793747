#include "ports/motion/clip.h"

#include <algorithm>
#include <filesystem>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "ports/motion/bvh.h"
#include "ports/motion/gltf_json.h"
#include "ports/motion/retarget_tree.h"
#include "ports/motion/smpl.h"

namespace figurine::ports {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFileBytes = size_t{1} << 29;
constexpr const char* kEmotes = "@dcl/wearable-preview";

// The sentence that the database's authors ask for.
constexpr const char* kCmuSource =
    "BVH conversion by B. Hahne, free for research and commercial use. The data used in this "
    "project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217.";

// Size and FNV-1a hash of 01_01.bvh and 01_03.bvh: a file is CMU's by what it holds, not by its
// name.
struct KnownClip {
  size_t size_bytes;
  uint64_t hash;
};
constexpr KnownClip kCmuClips[] = {{2070355, 0x5CFCB1FCB9F1C1B5}, {3415609, 0xE8B11A6503C460A9}};

uint64_t hash_of(std::span<const std::byte> bytes) {
  uint64_t hash = 14695981039346656037ull;
  for (const std::byte byte : bytes) hash = (hash ^ static_cast<uint64_t>(byte)) * 1099511628211ull;
  return hash;
}

std::string by_the_user(const fs::path& path) {
  return path.filename().string() + ": supplied by the user";
}

std::string bvh_source(const std::string& path) {
  const Result<MappedFile> file = MappedFile::open(path);
  const auto is_this = [&](const KnownClip& known) {
    return file.ok() && file->bytes().size() == known.size_bytes &&
           hash_of(file->bytes()) == known.hash;
  };
  if (std::none_of(std::begin(kCmuClips), std::end(kCmuClips), is_this)) return by_the_user(path);
  return fs::path(path).filename().string() + ": " + kCmuSource;
}

std::string glb_source(const fs::path& path) {
  std::error_code error;
  const fs::path clip = fs::absolute(path, error).lexically_normal(), folder = clip.parent_path();
  const Result<MappedFile> file =
      MappedFile::open((folder.parent_path() / "package.json").string());
  if (!file.ok()) return by_the_user(path);
  const Result<nlohmann::json> package = parse_gltf_json(file->bytes(), "package.json");
  if (!package.ok()) return by_the_user(path);
  FieldError missing;
  const Field root(*package, "", missing);
  const std::string name = root["name"].text(), version = root["version"].text(),
                    licence = root["license"].text();
  if (!missing.ok() || name != kEmotes || version.empty() || licence.empty())
    return by_the_user(path);
  return clip.filename().string() + ": " + (folder.filename() / clip.filename()).string() +
         " of the npm package " + name + " " + version + ", " + licence;
}

Result<std::string> package_source(const std::string& path) {
  const Result<MappedFile> file = MappedFile::open(path);
  if (!file.ok()) return file.status();
  const Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) return package.status();
  std::string source;
  for (const std::string& line : package->provenance().sources)
    source += (source.empty() ? "" : "; ") + line;
  return source;
}

}  // namespace

Result<ClipKind> clip_kind(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (extension == ".bvh") return ClipKind::kBvh;
  if (extension == ".npz") return ClipKind::kNpz;
  if (extension == ".fgn") return ClipKind::kPackage;
  for (const char* gltf : {".glb", ".gltf", ".vrma", ".vrm"}) {
    if (extension == gltf) return ClipKind::kGltf;
  }
  return Status(StatusCode::kUnsupported,
                path +
                    ": unsupported: a motion is a .bvh, .npz, .glb, .gltf or .vrma clip, or a "
                    "motion package .fgn");
}

Result<std::string> clip_source(const std::string& path) {
  const Result<ClipKind> kind = clip_kind(path);
  if (!kind.ok()) return kind.status();
  if (*kind == ClipKind::kBvh) return bvh_source(path);
  if (*kind == ClipKind::kGltf) return glb_source(path);
  if (*kind == ClipKind::kPackage) return package_source(path);
  return by_the_user(path);
}

Result<MotionClip> read_clip(std::span<const std::byte> bytes, const std::string& where,
                             ClipKind kind, const figurine::Body& body,
                             const RetargetOptions& options, RetargetReport* report) {
  FIG_CHECK(kind != ClipKind::kPackage, "a package is read from its file");
  if (bytes.size() > kMaxFileBytes)
    return Status(StatusCode::kLimitExceeded, where + ": larger than 512 MiB");
  if (options.source_fps && !(*options.source_fps >= 1 && *options.source_fps <= 1000))
    return Status(StatusCode::kInvalidArgument, "source fps: not within 1 and 1000");
  if (kind == ClipKind::kNpz) return retarget_smpl(bytes, where, body, options, report);
  Result<std::unique_ptr<ClipTree>> tree = Status(StatusCode::kCorrupt, where);
  if (kind == ClipKind::kBvh) {
    Result<Bvh> bvh = parse_bvh({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, where);
    if (!bvh.ok()) return bvh.status();
    tree = bvh_tree(std::move(bvh).value(), options);
  } else {
    tree = gltf_tree(bytes, where, options);
  }
  if (!tree.ok()) return tree.status();
  return retarget_tree(**tree, {.is_gltf = kind == ClipKind::kGltf}, body, options, report);
}

Result<MotionClip> read_clip(const std::string& path, const figurine::Body& body,
                             const RetargetOptions& options, RetargetReport* report) {
  const Result<ClipKind> kind = clip_kind(path);
  if (!kind.ok()) return kind.status();
  if (*kind == ClipKind::kPackage) return read_motion_clip(path);
  const Result<MappedFile> file = MappedFile::open(path);
  if (!file.ok()) return file.status();
  return read_clip(file->bytes(), path, *kind, body, options, report);
}

}  // namespace figurine::ports
