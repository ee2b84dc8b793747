#include "toolchain/body/gltf.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "ports/host/files.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

using Quat = Eigen::Quaterniond;
using Vec3 = Eigen::Vector3d;

constexpr uint32_t kMagic = 0x46546C67;      // "glTF", little-endian
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr size_t kMaxNodes = 4096;
constexpr size_t kMaxValues = size_t{1} << 26;
constexpr double kMaxMagnitude = 1e6;
constexpr double kMaxTimeS = 1e5;
constexpr size_t kMaxFileBytes = size_t{1} << 29;

// Text of the file for a message: short and on one line.
std::string excerpt(const std::string& text) {
  std::string out = text.substr(0, 64);
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return out;
}

// A value of the JSON and how to name it: "animations[0].samplers[3].input".
class Field {
 public:
  Field(const nlohmann::json& value, std::string path, const std::string& where)
      : value_(&value), path_(std::move(path)), where_(&where) {}

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(*where_ + ": " + (path_.empty() ? "JSON" : path_) + ": " + reason);
  }
  bool has(const char* key) const { return object().contains(key); }
  Field operator[](const char* key) const {
    const auto found = object().find(key);
    if (found == object().end()) named(key).fail("missing");
    return {*found, named(key).path_, *where_};
  }
  Field operator[](size_t index) const {  // index < size()
    return {(*value_)[index], path_ + "[" + std::to_string(index) + "]", *where_};
  }
  size_t size() const {
    if (!value_->is_array()) fail("not an array");
    return value_->size();
  }
  // An element of a top-level array, by the index that this field holds.
  Field of(const Field& array) const {
    const uint64_t index = count();
    if (index >= array.size())
      fail(std::to_string(index) + ": there are only " + std::to_string(array.size()) + " " +
           array.path_);
    return array[static_cast<size_t>(index)];
  }
  uint64_t count() const {
    if (!value_->is_number_unsigned()) fail("not a count");
    return value_->get<uint64_t>();
  }
  uint64_t count_or(const char* key, uint64_t otherwise) const {
    return has(key) ? (*this)[key].count() : otherwise;
  }
  double number() const {
    if (!value_->is_number()) fail("not a number");
    const double number = value_->get<double>();
    if (!(std::abs(number) <= kMaxMagnitude)) fail("not finite or out of range");
    return number;
  }
  std::string text() const {
    if (!value_->is_string()) fail("not a string");
    return excerpt(value_->get<std::string>());
  }
  bool flag_or_false(const char* key) const {
    if (!has(key)) return false;
    const Field field = (*this)[key];
    if (!field.value_->is_boolean()) field.fail("neither true nor false");
    return field.value_->get<bool>();
  }
  template <size_t N>
  std::array<double, N> numbers() const {
    if (size() != N) fail(std::to_string(size()) + " numbers, expected " + std::to_string(N));
    std::array<double, N> out{};
    for (size_t i = 0; i < N; ++i) out[i] = (*this)[i].number();
    return out;
  }

 private:
  const nlohmann::json& object() const {
    if (!value_->is_object()) fail("not an object");
    return *value_;
  }
  Field named(const char* key) const {
    return {*value_, path_.empty() ? key : path_ + "." + key, *where_};
  }

  const nlohmann::json* value_;
  std::string path_;
  const std::string* where_;
};

struct Chunks {
  std::span<const std::byte> json, bin;
  bool has_bin = false;
};

uint32_t word_at(std::span<const std::byte> bytes,
                 size_t offset) {  // hosts of the toolchain are little-endian, as the file is
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

Chunks chunks_of(std::span<const std::byte> bytes, const std::string& where) {
  const auto fail = [&](const std::string& reason) { throw InputError(where + ": " + reason); };
  if (bytes.size() < 12) fail("header: the file ends early");
  if (word_at(bytes, 0) != kMagic) fail("header: magic: not a binary glTF file");
  if (word_at(bytes, 4) != 2)
    fail("header: version " + std::to_string(word_at(bytes, 4)) + ": only 2 is read");
  if (word_at(bytes, 8) != bytes.size()) {
    fail("header: length: " + std::to_string(word_at(bytes, 8)) + " bytes, the file has " +
         std::to_string(bytes.size()));
  }
  Chunks chunks;
  size_t at = 12;
  for (size_t index = 0; at < bytes.size(); ++index) {
    const std::string name = "chunk " + std::to_string(index);
    if (bytes.size() - at < 8) fail(name + ": the file ends early");
    const uint32_t length = word_at(bytes, at), type = word_at(bytes, at + 4);
    at += 8;
    if (length > bytes.size() - at) {
      fail(name + ": length: " + std::to_string(length) + " bytes, " +
           std::to_string(bytes.size() - at) + " are left in the file");
    }
    if (length % 4 != 0) fail(name + ": length: not a multiple of 4");
    if ((index == 0) != (type == kJsonChunk))
      fail(name + ": type: the JSON chunk comes first and once");
    const auto body = bytes.subspan(at, length);
    if (index == 0) chunks.json = body;
    if (index == 1 && type == kBinChunk) {
      chunks.bin = body;
      chunks.has_bin = true;
    }
    at += length;
  }
  if (chunks.json.data() == nullptr) fail("chunk 0: no JSON chunk");
  return chunks;
}

// A matrix that is a translation, a rotation and a scale. Skinned skeletons hold no shear, and a
// mirror has no quaternion.
GltfTransform decomposed(const Field& field) {
  const std::array<double, 16> m = field.numbers<16>();  // column-major
  if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
    field.fail("the last row is not 0, 0, 0, 1");
  Eigen::Matrix3d linear;
  linear << m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10];
  GltfTransform out;
  out.translation = Vec3(m[12], m[13], m[14]);
  out.scale = linear.colwise().norm().transpose();
  if (!(out.scale.minCoeff() > 1e-9)) field.fail("an axis of no length");
  linear = linear * out.scale.cwiseInverse().asDiagonal();
  if ((linear.transpose() * linear - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-3)
    field.fail("sheared");
  if (linear.determinant() < 0) field.fail("mirrored");
  out.rotation = Quat(linear).normalized();
  return out;
}

GltfTransform rest_of(const Field& node) {
  if (node.has("matrix")) return decomposed(node["matrix"]);
  GltfTransform out;
  if (node.has("translation")) out.translation = Vec3(node["translation"].numbers<3>().data());
  if (node.has("rotation")) {
    const auto [x, y, z, w] = node["rotation"].numbers<4>();
    const Quat rotation(w, x, y, z);
    if (!(rotation.norm() > 1e-3)) node["rotation"].fail("a quaternion of no length");
    out.rotation = rotation.normalized();
  }
  if (node.has("scale")) {
    out.scale = Vec3(node["scale"].numbers<3>().data());
    if (out.scale.minCoeff() < 0) node["scale"].fail("mirrored");
  }
  return out;
}

void parse_nodes(const Field& root, Gltf& gltf) {
  const Field nodes = root["nodes"];
  if (nodes.size() > kMaxNodes) nodes.fail("more than 4096");
  gltf.nodes.resize(nodes.size());
  std::vector<std::vector<uint32_t>> children(nodes.size());
  for (size_t i = 0; i < nodes.size(); ++i) {
    const Field node = nodes[i];
    if (node.has("name")) gltf.nodes[i].name = node["name"].text();
    gltf.nodes[i].rest = rest_of(node);
    for (size_t c = 0; node.has("children") && c < node["children"].size(); ++c) {
      const Field child = node["children"][c];
      child.of(nodes);  // within range
      GltfNode& other = gltf.nodes[static_cast<size_t>(child.count())];
      if (other.parent >= 0)
        child.fail("node " + std::to_string(child.count()) + " has two parents");
      other.parent = static_cast<int>(i);
      children[i].push_back(static_cast<uint32_t>(child.count()));
    }
  }
  for (uint32_t i = 0; i < gltf.nodes.size(); ++i) {
    if (gltf.nodes[i].parent < 0) gltf.order.push_back(i);
  }
  for (size_t i = 0; i < gltf.order.size(); ++i) {
    for (const uint32_t child : children[gltf.order[i]]) gltf.order.push_back(child);
  }
  if (gltf.order.size() != gltf.nodes.size()) nodes.fail("children go in a circle");
}

// How a stored number becomes a float: glTF 2.0, section 3.11.
struct Component {
  uint64_t type;
  size_t bytes;
  float (*value)(const std::byte*);
};
template <class T>
float stored(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  if constexpr (std::is_floating_point_v<T>) return value;
  return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()),
                  -1.0f);
}
constexpr std::array<Component, 5> kComponents = {{{5120, 1, stored<int8_t>},
                                                   {5121, 1, stored<uint8_t>},
                                                   {5122, 2, stored<int16_t>},
                                                   {5123, 2, stored<uint16_t>},
                                                   {5126, 4, stored<float>}}};
constexpr uint64_t kFloat = 5126;

struct AccessorShape {
  const char* type;
  size_t width;
  bool may_be_integer;  // normalised
};

// Reads accessors of the file's own buffer.
class Accessors {
 public:
  Accessors(const Field& root, const Chunks& chunks) : root_(root), chunks_(chunks) {}

  std::vector<float> read(const Field& index, const AccessorShape& shape) {
    const Field accessor = index.of(root_["accessors"]);
    if (accessor["type"].text() != shape.type) {
      accessor["type"].fail("\"" + accessor["type"].text() + "\", expected " + shape.type);
    }
    const uint64_t stored_type = accessor["componentType"].count();
    const auto* component = std::find_if(kComponents.begin(), kComponents.end(),
                                         [&](const Component& c) { return c.type == stored_type; });
    if (component == kComponents.end() || (stored_type != kFloat && !shape.may_be_integer)) {
      accessor["componentType"].fail(std::to_string(stored_type) +
                                     ": not one that these keys may have");
    }
    if (stored_type != kFloat && !accessor.flag_or_false("normalized"))
      accessor.fail("integers that are not normalized");
    if (accessor.has("sparse")) accessor["sparse"].fail("unsupported: sparse keys are not read");

    const Field view = accessor["bufferView"].of(root_["bufferViews"]);
    const std::span<const std::byte> bytes = view_bytes(view);
    const size_t element = component->bytes * shape.width;
    const uint64_t stride = view.count_or("byteStride", element),
                   offset = accessor.count_or("byteOffset", 0);
    const uint64_t count = accessor["count"].count();
    if (stride < element || stride > 252)
      view["byteStride"].fail(std::to_string(stride) + ": not within the element's size and 252");
    if (count == 0) accessor["count"].fail("no elements");
    if (offset > bytes.size() || bytes.size() - offset < element ||
        (bytes.size() - offset - element) / stride < count - 1) {
      accessor.fail("reaches past the end of its buffer view of " + std::to_string(bytes.size()) +
                    " bytes");
    }
    // Counted over the whole animation: many samplers may name one accessor.
    if (count > (kMaxValues - values_read_) / shape.width)
      accessor["count"].fail("more than 2^26 key values in the animation");
    values_read_ += count * shape.width;
    std::vector<float> values;
    values.reserve(count * shape.width);
    for (uint64_t i = 0; i < count; ++i) {
      for (size_t k = 0; k < shape.width; ++k) {
        const float value =
            component->value(bytes.data() + offset + i * stride + k * component->bytes);
        if (!(std::abs(value) <= kMaxMagnitude))
          accessor.fail("element " + std::to_string(i) + ": not finite or out of range");
        values.push_back(value);
      }
    }
    return values;
  }

 private:
  std::span<const std::byte> view_bytes(const Field& view) const {
    if (view.has("extensions") && view["extensions"].has("EXT_meshopt_compression")) {
      view["extensions"].fail("unsupported: EXT_meshopt_compression");
    }
    const Field buffer = view["buffer"].of(root_["buffers"]);
    if (view["buffer"].count() != 0 || buffer.has("uri") || !chunks_.has_bin) {
      view["buffer"].fail("unsupported: only the file's own binary chunk is read");
    }
    const uint64_t buffer_bytes = buffer["byteLength"].count();
    if (buffer_bytes > chunks_.bin.size()) {
      buffer["byteLength"].fail(std::to_string(buffer_bytes) + " bytes, the binary chunk has " +
                                std::to_string(chunks_.bin.size()));
    }
    const uint64_t offset = view.count_or("byteOffset", 0), length = view["byteLength"].count();
    if (offset > buffer_bytes || length > buffer_bytes - offset) {
      view.fail("reaches past the end of its buffer of " + std::to_string(buffer_bytes) + " bytes");
    }
    return chunks_.bin.subspan(offset, length);
  }

  Field root_;
  Chunks chunks_;
  uint64_t values_read_ = 0;
};

GltfInterpolation interpolation_of(const Field& sampler) {
  if (!sampler.has("interpolation")) return GltfInterpolation::kLinear;
  const std::string name = sampler["interpolation"].text();
  if (name == "STEP") return GltfInterpolation::kStep;
  if (name == "LINEAR") return GltfInterpolation::kLinear;
  if (name == "CUBICSPLINE") return GltfInterpolation::kCubicSpline;
  sampler["interpolation"].fail("\"" + name + "\" is none of STEP, LINEAR and CUBICSPLINE");
}

size_t width_of(GltfPath path) { return path == GltfPath::kRotation ? 4 : 3; }

GltfTrack parse_track(const Field& sampler, GltfPath path, Accessors& accessors) {
  GltfTrack track;
  track.path = path;
  track.interpolation = interpolation_of(sampler);
  const Field input = sampler["input"], output = sampler["output"];
  track.times_s = accessors.read(input, {"SCALAR", 1, false});
  for (size_t i = 0; i < track.times_s.size(); ++i) {
    if (!(track.times_s[i] >= 0 && track.times_s[i] <= kMaxTimeS))
      input.fail("key " + std::to_string(i) + ": not within 0 and 1e5 s");
    if (i > 0 && !(track.times_s[i] > track.times_s[i - 1]))
      input.fail("key " + std::to_string(i) + ": not later than the one before");
  }
  const size_t width = width_of(path),
               rows = track.interpolation == GltfInterpolation::kCubicSpline ? 3 : 1;
  track.values =
      accessors.read(output, {width == 4 ? "VEC4" : "VEC3", width, path == GltfPath::kRotation});
  if (track.values.size() != track.times_s.size() * rows * width) {
    output.fail(std::to_string(track.values.size() / width) + " values for " +
                std::to_string(track.times_s.size()) + " keys");
  }
  for (size_t i = 0; i < track.times_s.size(); ++i) {
    const float* value = &track.values[(i * rows + rows / 2) * width];
    if (path == GltfPath::kRotation &&
        !(std::hypot(std::hypot(value[0], value[1]), std::hypot(value[2], value[3])) > 1e-3f)) {
      output.fail("key " + std::to_string(i) + ": a quaternion of no length");
    }
    if (path == GltfPath::kScale && std::min({value[0], value[1], value[2]}) < 0)
      output.fail("key " + std::to_string(i) + ": mirrored");
  }
  return track;
}

void parse_animation(const Field& root, const Chunks& chunks, Gltf& gltf) {
  if (!root.has("animations") || root["animations"].size() == 0)
    throw InputError(gltf.where + ": animations: there are none");
  const Field animations = root["animations"];
  if (gltf.animation >= animations.size()) {
    animations.fail("no number " + std::to_string(gltf.animation) + ": there are " +
                    std::to_string(animations.size()));
  }
  const Field animation = animations[gltf.animation], channels = animation["channels"],
              samplers = animation["samplers"];
  Accessors accessors(root, chunks);
  std::set<std::pair<uint64_t, GltfPath>> seen;
  for (size_t c = 0; c < channels.size(); ++c) {
    const Field target = channels[c]["target"];
    const std::string name = target["path"].text();
    if (name == "weights" || name == "pointer" || !target.has("node"))
      continue;  // of meshes, or of an extension
    GltfPath path;
    if (name == "translation") {
      path = GltfPath::kTranslation;
    } else if (name == "rotation") {
      path = GltfPath::kRotation;
    } else if (name == "scale") {
      path = GltfPath::kScale;
    } else {
      target["path"].fail("\"" + name + "\" is none of translation, rotation, scale and weights");
    }
    const Field node = target["node"].of(root["nodes"]);
    if (node.has("matrix"))
      target["node"].fail("node " + std::to_string(target["node"].count()) +
                          " has a matrix: it cannot be animated");
    if (!seen.emplace(target["node"].count(), path).second)
      target.fail("a second channel for the same node and path");
    GltfTrack track = parse_track(channels[c]["sampler"].of(samplers), path, accessors);
    track.node = static_cast<uint32_t>(target["node"].count());
    gltf.tracks.push_back(std::move(track));
  }
}

// One track at a time: [3] or [4] numbers, quaternions xyzw and unit.
Eigen::Vector4d value_at(const GltfTrack& track, double time_s) {
  const size_t width = width_of(track.path), keys = track.times_s.size();
  const bool cubic = track.interpolation == GltfInterpolation::kCubicSpline;
  // row 0: the tangent in, 1: the value, 2: the tangent out
  const auto row = [&](size_t key, size_t which) {
    const float* at = &track.values[(cubic ? key * 3 + which : key) * width];
    return Eigen::Vector4d(at[0], at[1], at[2], width == 4 ? double{at[3]} : 0);
  };
  const auto finished = [&](const Eigen::Vector4d& value) {
    if (width == 3) return value;
    // A spline through opposite quaternions may pass through zero: nothing better than the key is
    // known there.
    return value.norm() > 1e-6 ? Eigen::Vector4d(value.normalized()) : Eigen::Vector4d(0, 0, 0, 1);
  };
  const auto next = std::upper_bound(track.times_s.begin(), track.times_s.end(), time_s);
  if (next == track.times_s.begin()) return finished(row(0, 1));
  const size_t a = static_cast<size_t>(next - track.times_s.begin()) - 1;
  if (a + 1 == keys || track.interpolation == GltfInterpolation::kStep) return finished(row(a, 1));
  const double span_s = double{track.times_s[a + 1]} - double{track.times_s[a]},
               t = (time_s - double{track.times_s[a]}) / span_s;
  if (cubic) {
    const double t2 = t * t, t3 = t2 * t;
    return finished((2 * t3 - 3 * t2 + 1) * row(a, 1) + span_s * (t3 - 2 * t2 + t) * row(a, 2) +
                    (-2 * t3 + 3 * t2) * row(a + 1, 1) + span_s * (t3 - t2) * row(a + 1, 0));
  }
  if (width == 3) return (1 - t) * row(a, 1) + t * row(a + 1, 1);
  return Quat(finished(row(a, 1)))
      .slerp(t, Quat(finished(row(a + 1, 1))))
      .coeffs();  // along the shorter way
}

}  // namespace

std::vector<GltfTransform> Gltf::at(double time_s) const {
  std::vector<GltfTransform> out;
  out.reserve(nodes.size());
  for (const GltfNode& node : nodes) out.push_back(node.rest);
  for (const GltfTrack& track : tracks) {
    const Eigen::Vector4d value = value_at(track, time_s);
    GltfTransform& transform = out[track.node];
    if (track.path == GltfPath::kTranslation) transform.translation = value.head<3>();
    if (track.path == GltfPath::kRotation) transform.rotation = Quat(value).normalized();
    if (track.path == GltfPath::kScale) transform.scale = value.head<3>();
  }
  return out;
}

Gltf parse_glb(std::span<const std::byte> bytes, const std::string& where, uint32_t animation) {
  const Chunks chunks = chunks_of(bytes, where);
  nlohmann::json json;
  try {
    const auto* text = reinterpret_cast<const char*>(chunks.json.data());
    json = nlohmann::json::parse(text, text + chunks.json.size());
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(where + ": JSON: not valid at byte " + std::to_string(error.byte));
  } catch (const nlohmann::json::exception&) {
    throw InputError(where + ": JSON: a number is out of range");
  }
  Gltf gltf;
  gltf.where = where;
  gltf.animation = animation;
  const Field root(json, "", where);
  const Field asset = root["asset"];
  if (!asset["version"].text().starts_with("2."))
    asset["version"].fail("\"" + asset["version"].text() + "\": only 2.0 is read");
  parse_nodes(root, gltf);
  parse_animation(root, chunks, gltf);
  return gltf;
}

Gltf read_glb(const std::string& path, uint32_t animation) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path), "clip");
  if (file.bytes().size() > kMaxFileBytes) throw InputError(path + ": larger than 512 MiB");
  return parse_glb(file.bytes(), path, animation);
}

}  // namespace figurine::body
