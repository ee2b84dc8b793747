#include "toolchain/cli/glb_source.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace figurine::cli {
namespace {

constexpr const char* kEmotes = "@dcl/wearable-preview";

}  // namespace

std::string glb_source(const std::string& path) {
  namespace fs = std::filesystem;
  const fs::path clip = fs::absolute(path).lexically_normal(), folder = clip.parent_path();
  std::ifstream file(folder.parent_path() / "package.json");
  const nlohmann::json package = nlohmann::json::parse(file, nullptr, false);
  const auto text = [&](const char* key) {
    return package.is_object() && package.contains(key) && package[key].is_string() ? package[key].get<std::string>() : std::string();
  };
  const std::string name = text("name"), version = text("version"), licence = text("license");
  if (name != kEmotes || version.empty() || licence.empty()) return clip.filename().string() + ": supplied by the user";
  return clip.filename().string() + ": " + (folder.filename() / clip.filename()).string() + " of the npm package " + name + " " + version +
         ", " + licence;
}

}  // namespace figurine::cli
