#include "samples/figurine/roofline.h"

#include <cmath>
#include <fstream>
#include <iterator>

#include "ports/host/files.h"

namespace figurine::samples {

namespace {

// A texel's place, normal, joints and weights in a body's package.
constexpr uint64_t kSkinningBytes = 12 + 12 + kSkinInfluences * (1 + 4);
constexpr uint64_t kMapBytes = 6 * sizeof(float);  // a cell's position and normal
constexpr uint64_t kSplatBytes = 64;               // a projected Gaussian
constexpr uint64_t kPairBytes = 4;                 // a Gaussian's number in a tile's list
constexpr uint64_t kKeyBytes = 8;                  // a depth and a number, read and written
constexpr uint64_t kPixelBytes = 4;  // RGBA8 written; light and colours come from a tile in cache

Status wrong(const std::string& name, const std::string& field, const char* reason) {
  return Status(StatusCode::kCorrupt, name + ": " + field + ": " + reason);
}

// A number above 0.
bool is_rate(const nlohmann::json& object, const char* key) {
  return object.contains(key) && object[key].is_number() && object[key].get<double>() > 0;
}

Status check_row(const nlohmann::json& row, const std::string& name, const std::string& field) {
  if (!row.is_object()) return wrong(name, field, "is not an object");
  if (!row.contains("threads") || !row["threads"].is_number_unsigned())
    return wrong(name, field + ".threads", "is not a number of threads");
  for (const char* key : {"int8_macs_per_s", "f32_macs_per_s"}) {
    if (!is_rate(row, key)) return wrong(name, field + "." + key, "is not a rate above 0");
  }
  if (!row.contains("memory_bytes_per_s") || !row["memory_bytes_per_s"].is_object() ||
      !is_rate(row["memory_bytes_per_s"], "copy"))
    return wrong(name, field + ".memory_bytes_per_s.copy", "is not a rate above 0");
  if (!row.contains("blend_operations_per_s") || !row["blend_operations_per_s"].is_object())
    return wrong(name, field + ".blend_operations_per_s", "is not an object");
  for (const auto& [isa, rate] : row["blend_operations_per_s"].items()) {
    if (!is_rate(row["blend_operations_per_s"], isa.c_str()))
      return wrong(name, field + ".blend_operations_per_s." + isa, "is not a rate above 0");
  }
  return {};
}

}  // namespace

SceneSize size_of(const Scene& scene, uint64_t pixels) {
  SceneSize size{.pixels = pixels};
  for (size_t i = 0; i < scene.size(); ++i) {
    const Avatar& avatar = scene.avatar(i).avatar;
    const uint64_t texels = scene.body(i).package.body().texel_count();
    size.texels += texels;
    size.head_values += texels * head_channels(avatar.decoding.sh_degree);
    if (!avatar.has_network()) continue;
    const uint64_t step = avatar.texels_a_side() / avatar.network.input_size;
    size.cells += texels / (step * step);
  }
  return size;
}

uint64_t stage_bytes(Stage stage, const SceneSize& size, uint64_t visible, uint64_t pairs) {
  switch (stage) {
    case Stage::kMaps:
      return size.cells * (kSkinningBytes + kMapBytes);
    case Stage::kDecode:
      return size.head_values * sizeof(float);
    case Stage::kSkin:
      return size.texels * kSkinningBytes;
    case Stage::kProject:
      return size.gaussian_bytes + visible * kSplatBytes;
    case Stage::kBin:
      return visible * kSplatBytes + pairs * kPairBytes;
    case Stage::kSort:
      return visible * 2 * kKeyBytes;
    case Stage::kResolve:
      return size.pixels * kPixelBytes;
    case Stage::kNetwork:
    case Stage::kBlend:
      return 0;
  }
  return 0;
}

Result<Roofline> Roofline::load(const std::string& path) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status();
  const std::span<const std::byte> bytes = file->bytes();
  return parse(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), path);
}

Result<Roofline> Roofline::parse(const std::string& text, const std::string& name) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded() || !json.is_object()) return wrong(name, "roofline", "is not JSON");
  if (json.value("command", nlohmann::json()) != "roofline")
    return wrong(name, "command", "is not that of tests/bench/roofline");
  if (!json.contains("rows") || !json["rows"].is_array() || json["rows"].empty())
    return wrong(name, "rows", "are not there");
  Roofline roofline;
  roofline.name_ = name;
  roofline.rows_ = json["rows"];
  for (size_t i = 0; i < roofline.rows_.size(); ++i)
    FIG_RETURN_IF_ERROR(check_row(roofline.rows_[i], name, "rows[" + std::to_string(i) + "]"));
  if (json.contains("machine") && json["machine"].is_object() &&
      json["machine"].value("cpu", nlohmann::json()).is_string())
    roofline.cpu_ = json["machine"]["cpu"].get<std::string>();
  return roofline;
}

Result<nlohmann::ordered_json> Roofline::shares(const nlohmann::ordered_json& run,
                                                const std::string& isa,
                                                const SceneSize& size) const {
  const uint64_t threads = run["threads"].get<uint64_t>();
  const nlohmann::json* row = nullptr;
  for (const nlohmann::json& candidate : rows_) {
    if (candidate["threads"].get<uint64_t>() == threads) row = &candidate;
  }
  if (row == nullptr) {
    return Status(StatusCode::kNotFound,
                  name_ + ": rows: none of " + std::to_string(threads) + " threads");
  }
  if (!(*row)["blend_operations_per_s"].contains(isa)) {
    return Status(StatusCode::kNotFound, name_ + ": blend_operations_per_s: none of " + isa);
  }
  const auto& work = run["work"];
  const uint64_t visible = work["visible"].get<uint64_t>(), pairs = work["pairs"].get<uint64_t>();
  // Mixed precisions are held against the int8 peak, which is the higher one.
  const bool floats = run["precision"].is_string() && run["precision"] == "f32";
  nlohmann::ordered_json shares;
  for (size_t s = 0; s < kStageCount; ++s) {
    const Stage stage = static_cast<Stage>(s);
    const double seconds = run["stages_ms"][to_string(stage)]["median"].get<double>() * 1e-3;
    double done = 0, peak = 0;
    const char* unit = "bytes";
    if (stage == Stage::kNetwork) {
      done = work["macs"].get<double>();
      peak = (*row)[floats ? "f32_macs_per_s" : "int8_macs_per_s"].get<double>();
      unit = floats ? "float MACs" : "int8 MACs";
    } else if (stage == Stage::kBlend) {
      done = work["blends"].get<double>() * kBlendOperations;
      peak = (*row)["blend_operations_per_s"][isa].get<double>();
      unit = "lane operations";
    } else {
      done = static_cast<double>(stage_bytes(stage, size, visible, pairs));
      peak = (*row)["memory_bytes_per_s"]["copy"].get<double>();
    }
    if (!(seconds > 0) || done == 0) continue;
    shares[to_string(stage)] = {{"share", std::round(done / seconds / peak * 1e4) / 1e4},
                                {"of", unit},
                                {"a_frame", done},
                                {"peak_per_s", peak}};
  }
  return shares;
}

}  // namespace figurine::samples
