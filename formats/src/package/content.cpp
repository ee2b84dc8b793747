#include "formats/src/package/content.h"

#include <cmath>
#include <set>

#include "formats/src/package/text.h"

namespace figurine {

namespace {

// A list of a provenance, at most kMaxListEntries long; read_entry(entry, field of the entry).
template <class List, class ReadEntry>
Status read_list(const List* list, const std::string& field, ReadEntry read_entry) {
  if (list == nullptr) return {};
  if (list->size() > layout::kMaxListEntries) {
    return over_limit(field, "has more than ", layout::kMaxListEntries, " entries");
  }
  for (uint32_t i = 0; i < list->size(); ++i)
    FIG_RETURN_IF_ERROR(read_entry(list->Get(i), concatenate({field, "[", i, "]"})));
  return {};
}

}  // namespace

Status read_text(const flatbuffers::String* text, const std::string& field, uint32_t max_bytes,
                 std::string& out, bool allow_lines) {
  out.clear();
  if (text == nullptr) return {};
  if (text->size() > max_bytes) return over_limit(field, "is longer than ", max_bytes, " bytes");
  if (!is_clean_text(text->string_view(), allow_lines))
    return corrupt(field, "is not UTF-8 text without control characters");
  out = text->string_view();
  return {};
}

Status read_joint_names(const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>& list,
                        const std::string& field, std::vector<std::string>& out) {
  if (list.size() < 1) return corrupt(field, "names no joint");
  if (list.size() > kMaxJoints) return over_limit(field, "names more than ", kMaxJoints, " joints");
  out.resize(list.size());
  std::set<std::string_view> seen;
  for (uint32_t j = 0; j < list.size(); ++j) {
    const std::string entry = concatenate({field, "[", j, "]"});
    FIG_RETURN_IF_ERROR(read_text(list.Get(j), entry, layout::kMaxNameBytes, out[j]));
    if (out[j].empty()) return corrupt(entry, "is empty");
    if (!seen.insert(out[j]).second) return corrupt(entry, "'", out[j], "' is there twice");
  }
  return {};
}

Status check_magnitude(std::span<const float> values, const std::string& field, float max) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::fabs(values[i]) <= max) continue;
    if (!std::isfinite(values[i])) return corrupt(field, "value ", i, " is not finite");
    return corrupt(field, "value ", i, " is larger than ", max);
  }
  return {};
}

Status read_conventions(const schema::Conventions& conventions) {
  const bool known = conventions.length_unit() == schema::LengthUnit::Metre &&
                     conventions.axes() == schema::Axes::RightHandedYUp &&
                     conventions.colour_space() == schema::ColourSpace::SrgbEncodedStraightAlpha &&
                     conventions.rotation_format() == schema::RotationFormat::QuaternionWxyz &&
                     conventions.rest_frames() == schema::RestFrames::WorldAligned;
  return known ? Status()
               : unsupported("index.conventions",
                             "a unit, axis, colour or rotation convention is unknown");
}

Status read_provenance(const schema::Provenance& table, Provenance& out) {
  const auto word = [](const flatbuffers::String* text, const std::string& field,
                       std::string& value) {
    return read_text(text, "provenance." + field, layout::kMaxNameBytes, value);
  };
  FIG_RETURN_IF_ERROR(word(table.tool(), "tool", out.tool));
  FIG_RETURN_IF_ERROR(word(table.created(), "created", out.created));
  FIG_RETURN_IF_ERROR(word(table.licence_name(), "licence_name", out.licence_name));
  FIG_RETURN_IF_ERROR(read_text(table.licence_url(), "provenance.licence_url",
                                layout::kMaxTextBytes, out.licence_url));
  FIG_RETURN_IF_ERROR(word(table.avatar_permission(), "avatar_permission", out.avatar_permission));
  FIG_RETURN_IF_ERROR(word(table.commercial_usage(), "commercial_usage", out.commercial_usage));
  FIG_RETURN_IF_ERROR(read_text(table.depicted_person(), "provenance.depicted_person",
                                layout::kMaxTextBytes, out.depicted_person));
  const auto read_setting = [&](const schema::Setting* entry, const std::string& field) -> Status {
    KeyValue& setting = out.settings.emplace_back();
    FIG_RETURN_IF_ERROR(
        read_text(entry->key(), field + ".key", layout::kMaxNameBytes, setting.key));
    return read_text(entry->value(), field + ".value", layout::kMaxTextBytes, setting.value, true);
  };
  const auto read_source = [&](const flatbuffers::String* entry, const std::string& field) {
    return read_text(entry, field, layout::kMaxTextBytes, out.sources.emplace_back());
  };
  const auto read_author = [&](const flatbuffers::String* entry, const std::string& field) {
    return read_text(entry, field, layout::kMaxNameBytes, out.authors.emplace_back());
  };
  const auto read_metric = [&](const schema::QualityMetric* entry, const std::string& field) {
    QualityMetric& metric = out.quality.emplace_back();
    metric.value = entry->value();
    if (!std::isfinite(metric.value)) return corrupt(field, "is not finite");
    return read_text(entry->name(), field + ".name", layout::kMaxNameBytes, metric.name);
  };
  FIG_RETURN_IF_ERROR(read_list(table.settings(), "provenance.settings", read_setting));
  FIG_RETURN_IF_ERROR(read_list(table.sources(), "provenance.sources", read_source));
  FIG_RETURN_IF_ERROR(read_list(table.authors(), "provenance.authors", read_author));
  return read_list(table.quality(), "provenance.quality", read_metric);
}

Status read_motion(const schema::Index& index, BlobReader& blobs, Motion& out) {
  const schema::Motion& table = *index.content_as_Motion();
  FIG_RETURN_IF_ERROR(read_text(index.name(), "motion.name", layout::kMaxNameBytes, out.name));
  FIG_RETURN_IF_ERROR(
      read_joint_names(*table.joint_names(), "motion.joint_names", out.joint_names));
  out.frames_per_second = table.frames_per_second();
  if (!(out.frames_per_second > 0 && out.frames_per_second <= layout::kMaxFramesPerSecond)) {
    return corrupt("motion.frames_per_second", "is not above 0 and at most 10000");
  }
  const uint32_t joints = static_cast<uint32_t>(out.joint_names.size());
  FIG_RETURN_IF_ERROR(
      blobs.read("motion.root_translation", {BlobReader::kAny, 3}, out.root_translation_m));
  out.frame_count = static_cast<uint32_t>(out.root_translation_m.size() / 3);
  FIG_RETURN_IF_ERROR(blobs.read("motion.rotations", {out.frame_count, joints, 4}, out.rotations));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.root_translation_m, "motion.root_translation", layout::kMaxTranslationM));
  for (size_t i = 0; i < out.rotations.size(); i += 4) {
    double length2 = 0;
    for (size_t k = 0; k < 4; ++k) length2 += double(out.rotations[i + k]) * out.rotations[i + k];
    if (!(std::fabs(std::sqrt(length2) - 1) <= 1e-3)) {
      return corrupt("motion.rotations", "frame ", i / 4 / joints, ", joint ", i / 4 % joints,
                     ": not a unit quaternion");
    }
  }
  return {};
}

}  // namespace figurine
