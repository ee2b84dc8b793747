#include "toolchain/body/clip.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "toolchain/body/bvh.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEmotes = "@dcl/wearable-preview";

// The sentence that the database's authors ask for.
constexpr const char* kCmuSource =
    "BVH conversion by B. Hahne, free for research and commercial use. The data used in this "
    "project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217.";

std::string glb_source(const fs::path& path) {
  const fs::path clip = fs::absolute(path).lexically_normal(), folder = clip.parent_path();
  std::ifstream file(folder.parent_path() / "package.json");
  const nlohmann::json package = nlohmann::json::parse(file, nullptr, false);
  const auto text = [&](const char* key) {
    return package.is_object() && package.contains(key) && package[key].is_string()
               ? package[key].get<std::string>()
               : std::string();
  };
  const std::string name = text("name"), version = text("version"), licence = text("license");
  if (name != kEmotes || version.empty() || licence.empty())
    return clip.filename().string() + ": supplied by the user";
  return clip.filename().string() + ": " + (folder.filename() / clip.filename()).string() +
         " of the npm package " + name + " " + version + ", " + licence;
}

std::string package_source(const std::string& path) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path), path);
  const Package package = value_or_throw(Package::open(file.bytes(), path), path);
  std::string source;
  for (const std::string& line : package.provenance().sources)
    source += (source.empty() ? "" : "; ") + line;
  return source;
}

}  // namespace

std::string clip_source(const std::string& path) {
  const fs::path file(path);
  if (file.extension() == ".bvh") return file.filename().string() + ": " + kCmuSource;
  if (file.extension() == ".glb") return glb_source(file);
  if (file.extension() == ".fgn") return package_source(path);
  return file.filename().string() + ": supplied by the user";
}

MotionClip read_clip(const std::string& path, const figurine::Body& body,
                     const RetargetOptions& options, RetargetReport* report) {
  const std::string extension = fs::path(path).extension().string();
  if (extension == ".bvh") return retarget_bvh(read_bvh(path), body, options, report);
  if (extension == ".npz") return retarget_npz(path, body, options, report);
  if (extension == ".glb") return retarget_glb(path, body, options, report);
  if (extension == ".fgn") return read_motion_clip(path);
  throw InputError(
      path + ": unsupported: a motion is a .bvh, .npz or .glb clip, or a motion package .fgn");
}

}  // namespace figurine::body
