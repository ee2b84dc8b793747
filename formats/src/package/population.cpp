// The meaning of a population package: one network whose initial weights fit it, members of
// distinct names, and for each of them differences, shape, statistics and a pose of the right size
// that make a sound avatar.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "figurine/detail/memory_reserve.h"
#include "figurine/detail/rans.h"
#include "formats/src/package/content.h"
#include "formats/src/package/text.h"

namespace figurine {

namespace {

constexpr float kMaxWeight = std::numeric_limits<float>::max() /
                             4;  // of initial weights and differences: their sum is finite
constexpr float kMaxScale = kMaxWeight / 127;

using Strings = flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>;

// A list of texts; none if absent.
Status read_texts(const Strings* list, const std::string& field, uint32_t max_bytes,
                  bool allow_lines, std::vector<std::string>& out) {
  if (list == nullptr) return {};
  if (list->size() > layout::kMaxListEntries)
    return over_limit(field, "has more than ", layout::kMaxListEntries, " entries");
  out.resize(list->size());
  for (uint32_t i = 0; i < list->size(); ++i) {
    FIG_RETURN_IF_ERROR(
        read_text(list->Get(i), concatenate({field, "[", i, "]"}), max_bytes, out[i], allow_lines));
  }
  return {};
}

Status read_own_provenance(const schema::Member& table, Provenance& out) {
  const auto word = [](const flatbuffers::String* text, const char* field, std::string& value) {
    return read_text(text, field, layout::kMaxNameBytes, value);
  };
  FIG_RETURN_IF_ERROR(word(table.tool(), "tool", out.tool));
  FIG_RETURN_IF_ERROR(word(table.created(), "created", out.created));
  FIG_RETURN_IF_ERROR(word(table.licence_name(), "licence_name", out.licence_name));
  FIG_RETURN_IF_ERROR(
      read_text(table.licence_url(), "licence_url", layout::kMaxTextBytes, out.licence_url));
  FIG_RETURN_IF_ERROR(word(table.avatar_permission(), "avatar_permission", out.avatar_permission));
  FIG_RETURN_IF_ERROR(word(table.commercial_usage(), "commercial_usage", out.commercial_usage));
  FIG_RETURN_IF_ERROR(read_text(table.depicted_person(), "depicted_person", layout::kMaxTextBytes,
                                out.depicted_person));
  FIG_RETURN_IF_ERROR(
      read_texts(table.sources(), "sources", layout::kMaxTextBytes, false, out.sources));
  FIG_RETURN_IF_ERROR(
      read_texts(table.authors(), "authors", layout::kMaxNameBytes, false, out.authors));
  std::vector<std::string> settings;
  FIG_RETURN_IF_ERROR(
      read_texts(table.settings(), "settings", layout::kMaxTextBytes, true, settings));
  if (settings.size() % 2 != 0) return corrupt("settings", "the last key has no value");
  for (size_t i = 0; i < settings.size(); i += 2) {
    if (settings[i].size() > layout::kMaxNameBytes)
      return over_limit("settings", "a key is longer than ", layout::kMaxNameBytes, " bytes");
    if (!is_clean_text(settings[i], false)) return corrupt("settings", "a key has several lines");
    out.settings.push_back({settings[i], settings[i + 1]});
  }
  return {};
}

Status read_member_table(const schema::Member& table, size_t quality_count, PopulationMember& out,
                         Provenance& own) {
  FIG_RETURN_IF_ERROR(read_text(table.name(), "name", layout::kMaxNameBytes, out.name));
  if (out.name.empty()) return corrupt("name", "is empty");
  if (out.name.find('#') != std::string::npos)
    return corrupt("name", "has a '#' in it, which stands between a package and a member");
  if (table.split() > schema::Split::MAX) return unsupported("split", "is unknown");
  out.split = static_cast<Split>(table.split());
  FIG_RETURN_IF_ERROR(read_maps_and_head(table, "avatar", out));
  if (table.golden() != nullptr) FIG_RETURN_IF_ERROR(read_golden_view(*table.golden(), out.golden));
  const auto* quality = table.quality();
  const size_t figures = quality == nullptr ? 0 : quality->size();
  if (figures != quality_count)
    return corrupt("quality", "has ", figures, " figures for ", quality_count, " names");
  if (figures > 0) {
    // By bytes: the Verifier wants no alignment of a vector's elements, and a forged one has none.
    out.quality.resize(figures);
    std::memcpy(out.quality.data(), quality->Data(), figures * sizeof(double));
  }
  for (const double value : out.quality) {
    if (std::isinf(value)) return corrupt("quality", "a figure is infinite");
  }
  return read_own_provenance(table, own);
}

Status read_members(const schema::Population& table, PopulationContent& out) {
  const auto& list = *table.members();
  if (list.size() < 1) return corrupt("population.members", "there is none");
  if (list.size() > kMaxMembers)
    return over_limit("population.members", "has more than ", kMaxMembers, " entries");
  Population& population = out.population;
  population.members.resize(list.size());
  out.own.resize(list.size());
  std::set<std::string_view> names;
  const bool has_golden = list.Get(0)->golden() != nullptr;
  for (uint32_t m = 0; m < list.size(); ++m) {
    const std::string field = concatenate({"population.members[", m, "]"});
    PopulationMember& member = population.members[m];
    FIG_RETURN_IF_ERROR(
        read_member_table(*list.Get(m), population.quality_names.size(), member, out.own[m])
            .within(field));
    if (!names.insert(member.name).second)
      return corrupt(field, "'", member.name, "' is there twice");
    if ((list.Get(m)->golden() != nullptr) != has_golden)
      return corrupt(field, "a golden pose is not there for all members or for none");
  }
  return {};
}

Status check_scales(std::span<const float> scales, const std::string& field, float most) {
  for (size_t i = 0; i < scales.size(); ++i) {
    if (!(scales[i] >= std::numeric_limits<float>::min() && scales[i] <= most))
      return corrupt(field, "value ", i, " is not positive, or too large");
  }
  return {};
}

Status check_frequencies(std::span<const int16_t> frequency, const std::string& field) {
  for (size_t at = 0; at < frequency.size(); at += kRansValues) {
    int64_t sum = 0;
    for (size_t k = at; k < at + kRansValues; ++k) {
      if (frequency[k] < 0) return corrupt(field, "value ", k, " is negative");
      sum += frequency[k];
    }
    if (sum != int64_t{kRansTotal})
      return corrupt(field, "row ", at / kRansValues, " has the sum ", sum, ", not ", kRansTotal);
  }
  return {};
}

// The members' streams "population.NAMEcode", one after the other, and their tables, `rows` of
// them.
Status read_streams(BlobReader& blobs, const std::string& name, uint32_t members, uint32_t rows,
                    std::span<const int16_t>& frequency, std::span<const uint8_t>& code,
                    std::span<const uint32_t>& code_end) {
  const std::string prefix = concatenate({"population.", name});
  FIG_RETURN_IF_ERROR(blobs.read(prefix + "frequency", {rows, uint32_t{kRansValues}}, frequency));
  FIG_RETURN_IF_ERROR(blobs.read(prefix + "code", {BlobReader::kAny}, code));
  FIG_RETURN_IF_ERROR(blobs.read(prefix + "code_end", {members}, code_end));
  FIG_RETURN_IF_ERROR(check_frequencies(frequency, prefix + "frequency"));
  if (!std::is_sorted(code_end.begin(), code_end.end()) || code_end.back() != code.size()) {
    return corrupt(prefix + "code_end", "is not ascending, or does not end where ", prefix,
                   "code does");
  }
  return {};
}

Status read_int8(BlobReader& blobs, uint32_t members, uint32_t rows, uint32_t convolutions,
                 Population& out) {
  FIG_RETURN_IF_ERROR(blobs.read("population.scale", {members, rows}, out.scale));
  FIG_RETURN_IF_ERROR(check_scales(out.scale, "population.scale", kMaxScale));
  return read_streams(blobs, "", members, convolutions, out.frequency, out.code, out.code_end);
}

// Bounds as validate_static_part has them for an avatar's scales.
Status read_static_streams(BlobReader& blobs, Population& out) {
  if (out.static_part.empty()) return {};
  const auto members = static_cast<uint32_t>(out.size());
  uint32_t channels = 0;
  for (const StaticGroup& group : out.static_part.groups) channels += group.channels;
  FIG_RETURN_IF_ERROR(blobs.read("population.static_scale", {members, channels}, out.static_scale));
  FIG_RETURN_IF_ERROR(read_streams(blobs, "static_", members, channels, out.static_frequency,
                                   out.static_code, out.static_code_end));
  for (uint32_t m = 0; m < members; ++m) {
    StaticPart own = out.static_part;
    uint32_t channel = m * channels;
    for (StaticGroup& group : own.groups) {
      group.scale = out.static_scale.subspan(channel, group.channels);
      channel += group.channels;
    }
    FIG_RETURN_IF_ERROR(
        validate_static_scales(own).within(concatenate({"population.static_scale: member ", m})));
  }
  return {};
}

Status check_halves(std::span<const Half> values, const std::string& field) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (!is_finite(values[i])) return corrupt(field, "value ", i, " is not finite");
  }
  return {};
}

Status read_differences(BlobReader& blobs, Population& out) {
  uint64_t weights = 0, rows = 0;
  uint32_t convolutions = 0;
  for (size_t i = 0; i < out.network.layers.size(); ++i) {
    const Layer& layer = out.network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    FIG_RETURN_IF_ERROR(
        check_magnitude(layer.weights, concatenate({"initial.", i, ".weights"}), kMaxWeight));
    weights += layer.weights.size();
    rows += layer.bias.size();
    ++convolutions;
  }
  if (weights > std::numeric_limits<uint32_t>::max())
    return over_limit("population.network", "has more than 2^32 weights");
  if (out.coding == DifferenceCoding::kNone) return {};
  const auto members = static_cast<uint32_t>(out.size()), channels = static_cast<uint32_t>(rows);
  FIG_RETURN_IF_ERROR(blobs.read("population.bias", {members, channels}, out.bias));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.bias, "population.bias", std::numeric_limits<float>::max()));
  if (out.coding == DifferenceCoding::kInt8)
    return read_int8(blobs, members, channels, convolutions, out);
  FIG_RETURN_IF_ERROR(blobs.read("population.difference", {members, static_cast<uint32_t>(weights)},
                                 out.difference));
  return check_halves(out.difference, "population.difference");
}

Status read_statistics(const schema::Population& table, BlobReader& blobs, Population& out) {
  if (table.pose_joints() == nullptr) return {};
  FIG_RETURN_IF_ERROR(
      read_statistics_joints(*table.pose_joints(), "population.pose_joints", out.pose_joints));
  const auto members = static_cast<uint32_t>(out.size()),
             n = static_cast<uint32_t>(3 * out.pose_joints.size());
  FIG_RETURN_IF_ERROR(blobs.read("pose.mean", {members, n}, out.pose_mean));
  FIG_RETURN_IF_ERROR(check_magnitude(out.pose_mean, "pose.mean", 100));
  FIG_RETURN_IF_ERROR(blobs.read("pose.factor", {members, n * (n + 1) / 2}, out.pose_factor));
  FIG_RETURN_IF_ERROR(check_halves(out.pose_factor, "pose.factor"));
  const MemoryReserve reserve(size_t{n} * n * sizeof(float));
  if (!reserve.held()) return no_memory();
  std::vector<float> covariance(size_t{n} * n);
  for (uint32_t m = 0; m < members; ++m) {
    pose_covariance(out, m, covariance);
    FIG_RETURN_IF_ERROR(check_covariance(covariance, n, concatenate({"pose.factor: member ", m})));
  }
  return {};
}

Status read_golden_poses(const schema::Population& table, BlobReader& blobs, Population& out) {
  if (table.members()->Get(0)->golden() == nullptr) return {};
  const auto members = static_cast<uint32_t>(out.size());
  FIG_RETURN_IF_ERROR(
      blobs.read("golden.rotations", {members, BlobReader::kAny, 4}, out.golden_poses));
  const size_t row = out.golden_poses.size() / members;
  for (uint32_t m = 0; m < members; ++m) {
    out.members[m].golden.rotations = out.golden_poses.subspan(m * row, row);
    FIG_RETURN_IF_ERROR(check_golden_pose(out.members[m].golden)
                            .within(concatenate({"population.members[", m, "]"})));
  }
  return {};
}

// Each member's head and maps against the network, as an avatar package's.
Status check_members_fit(const Population& population, const Budget& budget) {
  for (size_t m = 0; m < population.size(); ++m) {
    FIG_RETURN_IF_ERROR(
        check_network_fits(population, population.members[m].decoding, "avatar", budget)
            .within(concatenate({"population.members[", m, "]"})));
  }
  return {};
}

}  // namespace

Status read_population(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                       PopulationContent& content) {
  const schema::Population& table = *index.content_as_Population();
  Population& out = content.population;
  FIG_RETURN_IF_ERROR(read_text(index.name(), "population.name", layout::kMaxNameBytes, out.name));
  FIG_RETURN_IF_ERROR(read_kind(table, "population", out));
  if (table.coding() > schema::DifferenceCoding::MAX)
    return unsupported("population.coding", "is unknown");
  out.coding = static_cast<DifferenceCoding>(table.coding());
  FIG_RETURN_IF_ERROR(read_texts(table.quality_names(), "population.quality_names",
                                 layout::kMaxNameBytes, false, out.quality_names));
  FIG_RETURN_IF_ERROR(read_members(table, content));
  FIG_RETURN_IF_ERROR(check_members_fit(out, budget));
  FIG_RETURN_IF_ERROR(read_uv_size(table.uv_size(), out, "population", out.uv_size));
  FIG_RETURN_IF_ERROR(check_gaussians(budget, out.texels_a_side()));
  out.antialiased = table.antialiased();
  FIG_RETURN_IF_ERROR(read_convolutions(blobs, "initial", BlobReader::kRequired, out.network));
  FIG_RETURN_IF_ERROR(read_differences(blobs, out));
  FIG_RETURN_IF_ERROR(read_static_part(table.static_groups(), "population", out.texels_a_side(),
                                       blobs, out.static_part));
  FIG_RETURN_IF_ERROR(read_static_streams(blobs, out));
  if (out.coding == DifferenceCoding::kNone && out.static_part.empty())
    return corrupt("population.coding", "says that nobody differs, and there is no static part");
  const auto members = static_cast<uint32_t>(out.size());
  FIG_RETURN_IF_ERROR(blobs.read("population.shape", {members, BlobReader::kAny}, out.shape,
                                 BlobReader::kMayBeAbsent));
  if (out.shape.size() > size_t{kMaxShapeCoefficients} * members) {
    return over_limit("population.shape", "has more than ", kMaxShapeCoefficients,
                      " coefficients a member");
  }
  FIG_RETURN_IF_ERROR(check_magnitude(out.shape, "population.shape", 1000));
  FIG_RETURN_IF_ERROR(read_statistics(table, blobs, out));
  return read_golden_poses(table, blobs, out);
}

}  // namespace figurine
