#include "samples/common/pose_json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "ports/host/files.h"
#include "ports/host/nearest_names.h"
#include "samples/common/quaternion.h"

namespace figurine::samples {

namespace {

using Json = nlohmann::json;

constexpr const char* kRoot = "root_translation_m";
constexpr const char* kJoints = "joints";
constexpr double kShortestQuaternion = 1e-6;  // as validate_pose has it
constexpr size_t kLongestShownName = 64;

Status refused(const std::string& where, const std::string& what) {
  return Status(StatusCode::kInvalidArgument, where + ": " + what);
}

// A name from outside, fit for a terminal.
std::string shown(std::string_view name) {
  std::string text = "'";
  for (const char c : name.substr(0, kLongestShownName)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (name.size() > kLongestShownName ? "...'" : "'");
}

// What is the matter with JSON, without the library's own number of the error.
std::string reason_of(const Json::exception& error) {
  const std::string_view what = error.what();
  const size_t end = what.find("] ");
  std::string reason(end == std::string_view::npos ? what : what.substr(end + 2));
  for (char& c : reason) {
    if (c < ' ' || c > '~') c = '?';
  }
  return reason;
}

// Parses; keys that come twice are an error, of which the library would keep the last silently.
Result<Json> parse_json(std::string_view text, const std::string& where) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  std::string twice;
  const auto note = [&](int, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(value.get<std::string>()).second &&
        twice.empty())
      twice = value.get<std::string>();
    return true;
  };
  try {
    Json json = Json::parse(text, note);
    if (!twice.empty()) return refused(where, shown(twice) + ": is there twice");
    if (!json.is_object()) return refused(where, "pose: not a JSON object");
    return json;
  } catch (const Json::exception& error) {
    return refused(where, "pose: " + reason_of(error));
  }
}

// A list of numbers that fit into floats; where names the field.
Result<std::vector<double>> read_numbers(const Json& json, const std::string& where) {
  if (!json.is_array()) return refused(where, "not a list of numbers");
  std::vector<double> values;
  for (const Json& entry : json) {
    if (!entry.is_number()) return refused(where, "not a list of numbers");
    values.push_back(entry.get<double>());
    if (!std::isfinite(static_cast<float>(values.back())))
      return refused(where, "a value is beyond what a float holds");
  }
  return values;
}

Status read_root(const Json& json, const std::string& where, std::array<float, 3>& out) {
  const Result<std::vector<double>> values = read_numbers(json, where);
  if (!values.ok()) return values.status();
  if (values->size() != 3)
    return refused(where, "has " + std::to_string(values->size()) + " numbers, not 3");
  for (size_t k = 0; k < 3; ++k) {
    if (std::abs((*values)[k]) > kFarthestRoot_m)
      return refused(where, "a value is beyond 10000 metres");
    out[k] = static_cast<float>((*values)[k]);
  }
  return {};
}

Status read_rotation(const Json& json, const std::string& where, float* wxyz) {
  const Result<std::vector<double>> values = read_numbers(json, where);
  if (!values.ok()) return values.status();
  const std::vector<double>& v = *values;
  if (v.size() == 4) {
    if (std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]) < kShortestQuaternion)
      return refused(where, "a quaternion of no length turns nothing");
    for (size_t k = 0; k < 4; ++k) wxyz[k] = static_cast<float>(v[k]);
    return {};
  }
  if (v.size() != 3) {
    return refused(where, "has " + std::to_string(v.size()) +
                              " numbers, neither 4 (quaternion wxyz) nor 3 (axis times angle)");
  }
  const glm::dvec3 axis(v[0], v[1], v[2]);
  const double angle = glm::length(axis);
  if (angle > 1e6) return refused(where, "an angle is beyond a million radians");
  const glm::quat q = angle > 0 ? rotation_about(axis / angle, angle) : glm::quat(1, 0, 0, 0);
  store_quaternion(q, wxyz);
  return {};
}

// The field of an object that nobody knows, with the names that it may have meant.
Status unknown(const std::string& where, const std::string& what, const std::string& name,
               std::span<const std::string> names) {
  std::string message = what + " " + shown(name) + ": there is none of this name";
  const std::vector<std::string> nearest = ports::nearest_names(name, names);
  for (size_t i = 0; i < nearest.size(); ++i)
    message += (i == 0 ? "; nearest: " : ", ") + nearest[i];
  return refused(where, message);
}

void append_number(float value, std::string& text) {
  char digits[32];
  const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), value);
  text.append(digits, end);
}

void append_numbers(std::span<const float> values, std::string& text) {
  for (size_t i = 0; i < values.size(); ++i) {
    text += i == 0 ? "[" : ", ";
    append_number(values[i], text);
  }
  text += "]";
}

}  // namespace

StoredPose rest_pose(size_t joint_count) {
  StoredPose pose;
  for (size_t j = 0; j < joint_count; ++j)
    pose.rotations.insert(pose.rotations.end(), {1, 0, 0, 0});
  return pose;
}

Result<StoredPose> parse_pose_json(std::string_view text, std::span<const std::string> joint_names,
                                   const std::string& where) {
  const Result<Json> json = parse_json(text, where);
  if (!json.ok()) return json.status();
  StoredPose pose = rest_pose(joint_names.size());
  for (const auto& [field, value] : json->items()) {
    if (field == kRoot) {
      FIG_RETURN_IF_ERROR(read_root(value, where + ": " + kRoot, pose.root_translation_m));
    } else if (field != kJoints) {
      const std::string fields[] = {kRoot, kJoints};
      return unknown(where, "field", field, fields);
    } else if (!value.is_object()) {
      return refused(where, std::string(kJoints) + ": not an object of names and rotations");
    }
  }
  if (!json->contains(kJoints)) return pose;
  for (const auto& [name, rotation] : (*json)[kJoints].items()) {
    const auto at = std::find(joint_names.begin(), joint_names.end(), name);
    if (at == joint_names.end()) return unknown(where, "joint", name, joint_names);
    FIG_RETURN_IF_ERROR(read_rotation(rotation, where + ": joint " + shown(name),
                                      &pose.rotations[4 * size_t(at - joint_names.begin())]));
  }
  return pose;
}

Result<StoredPose> load_pose_json(const std::string& path,
                                  std::span<const std::string> joint_names) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) return file.status().within("pose");
  const std::string_view text(reinterpret_cast<const char*>(file->bytes().data()),
                              file->bytes().size());
  constexpr std::string_view kPackage =
      "\x8F"
      "FGN";
  if (text.starts_with(kPackage)) {
    return refused(path,
                   "pose: is a package, not JSON; a motion is played by --motion, and "
                   "figurine pose writes one frame of it as JSON");
  }
  return parse_pose_json(text, joint_names, path);
}

std::string write_pose_json(const PoseView& pose, std::span<const std::string> joint_names) {
  FIG_CHECK(pose.rotations.size() == 4 * joint_names.size(), "a rotation for each joint");
  std::string text = "{\n  \"" + std::string(kRoot) + "\": ";
  append_numbers(pose.root_translation_m, text);
  text += ",\n  \"" + std::string(kJoints) + "\": {";
  for (size_t j = 0; j < joint_names.size(); ++j) {
    text += j == 0 ? "\n    " : ",\n    ";
    // Names come from a package: the library escapes what JSON wants escaped.
    text += Json(joint_names[j]).dump(-1, ' ', false, Json::error_handler_t::replace) + ": ";
    append_numbers(pose.rotations.subspan(4 * j, 4), text);
  }
  return text + "\n  }\n}\n";
}

}  // namespace figurine::samples
