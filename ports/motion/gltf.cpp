#include "ports/motion/gltf.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>

#include "ports/motion/gltf_json.h"

namespace figurine::ports {
namespace {

constexpr uint32_t kMagic = 0x46546C67;      // "glTF", little-endian
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr size_t kMaxNodes = 4096;
constexpr size_t kMaxValues = size_t{1} << 26;
constexpr double kMaxMagnitude = 1e6;
constexpr double kMaxTimeS = 1e5;

struct Chunks {
  std::span<const std::byte> json, bin;
  bool has_bin = false;
};

uint32_t word_at(std::span<const std::byte> bytes, size_t offset) {  // hosts are little-endian
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

Result<Chunks> chunks_of(std::span<const std::byte> bytes, const std::string& where) {
  const auto fail = [&](const std::string& reason) {
    return Status(StatusCode::kCorrupt, where + ": " + reason);
  };
  Chunks chunks;
  // JSON alone begins with a brace, behind blanks or a byte order mark.
  size_t at = 0;
  if (bytes.size() > 3 && (word_at(bytes, 0) & 0xFFFFFF) == 0xBFBBEF) at = 3;
  const size_t text = at;
  while (at < bytes.size() && (bytes[at] == std::byte{' '} || bytes[at] == std::byte{'\t'} ||
                               bytes[at] == std::byte{'\n'} || bytes[at] == std::byte{'\r'})) {
    ++at;
  }
  if (at < bytes.size() && bytes[at] == std::byte{'{'}) {
    chunks.json = bytes.subspan(text);
    return chunks;
  }
  if (bytes.size() < 12) return fail("header: the file ends early");
  if (word_at(bytes, 0) != kMagic) return fail("header: magic: not a glTF file");
  if (word_at(bytes, 4) != 2)
    return fail("header: version " + std::to_string(word_at(bytes, 4)) + ": only 2 is read");
  if (word_at(bytes, 8) != bytes.size()) {
    return fail("header: length: " + std::to_string(word_at(bytes, 8)) + " bytes, the file has " +
                std::to_string(bytes.size()));
  }
  at = 12;
  for (size_t index = 0; at < bytes.size(); ++index) {
    const std::string name = "chunk " + std::to_string(index);
    if (bytes.size() - at < 8) return fail(name + ": the file ends early");
    const uint32_t length = word_at(bytes, at), type = word_at(bytes, at + 4);
    at += 8;
    if (length > bytes.size() - at) {
      return fail(name + ": length: " + std::to_string(length) + " bytes, " +
                  std::to_string(bytes.size() - at) + " are left in the file");
    }
    if (length % 4 != 0) return fail(name + ": length: not a multiple of 4");
    if ((index == 0) != (type == kJsonChunk))
      return fail(name + ": type: the JSON chunk comes first and once");
    const auto body = bytes.subspan(at, length);
    if (index == 0) chunks.json = body;
    if (index == 1 && type == kBinChunk) {
      chunks.bin = body;
      chunks.has_bin = true;
    }
    at += length;
  }
  if (chunks.json.data() == nullptr) return fail("chunk 0: no JSON chunk");
  return chunks;
}

// A matrix that is a translation, a rotation and a scale. Skinned skeletons hold no shear, and a
// mirror has no quaternion.
GltfTransform decomposed(const Field& field) {
  const std::array<double, 16> m = field.numbers<16>();  // column-major
  if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
    field.fail("the last row is not 0, 0, 0, 1");
  Mat3 linear{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
  GltfTransform out;
  out.translation = Vec3(m[12], m[13], m[14]);
  out.scale = Vec3(length(linear[0]), length(linear[1]), length(linear[2]));
  if (!(std::min({out.scale.x, out.scale.y, out.scale.z}) > 1e-9))
    field.fail("an axis of no length");
  if (!field.ok()) return {};
  for (int i = 0; i < 3; ++i) linear[i] *= 1 / out.scale[i];
  double shear = 0;
  for (int i = 0; i < 3; ++i)
    shear = std::max(shear, std::abs(dot(linear[i], linear[(i + 1) % 3])));
  if (shear > 1e-3) field.fail("sheared");
  if (dot(cross(linear[0], linear[1]), linear[2]) < 0) field.fail("mirrored");
  out.rotation = unit(quaternion_of(linear));
  return out;
}

Vec3 vector_of(const Field& field) {
  const auto [x, y, z] = field.numbers<3>();
  return {x, y, z};
}

GltfTransform rest_of(const Field& node) {
  if (node.has("matrix")) return decomposed(node["matrix"]);
  GltfTransform out;
  if (node.has("translation")) out.translation = vector_of(node["translation"]);
  if (node.has("rotation")) {
    const auto [x, y, z, w] = node["rotation"].numbers<4>();
    const Quat rotation(w, x, y, z);
    if (!(std::sqrt(dot(rotation, rotation)) > 1e-3))
      node["rotation"].fail("a quaternion of no length");
    out.rotation = unit(rotation);
  }
  if (node.has("scale")) {
    out.scale = vector_of(node["scale"]);
    if (std::min({out.scale.x, out.scale.y, out.scale.z}) < 0) node["scale"].fail("mirrored");
  }
  return out;
}

void parse_nodes(const Field& root, Gltf& gltf) {
  const Field nodes = root["nodes"];
  if (nodes.size() > kMaxNodes) return nodes.fail("more than 4096");
  gltf.nodes.resize(nodes.size());
  std::vector<std::vector<uint32_t>> children(nodes.size());
  for (size_t i = 0; i < nodes.size() && root.ok(); ++i) {
    const Field node = nodes[i];
    if (!node.is_object()) return node.fail("not an object");
    FieldError own;
    if (node.has("name")) gltf.nodes[i].name = node.with(own)["name"].text();
    gltf.nodes[i].rest = rest_of(node.with(own));
    gltf.nodes[i].defect = own.text;
    const size_t count = node.has("children") ? node["children"].size() : 0;
    for (size_t c = 0; c < count && root.ok(); ++c) {
      const Field child = node["children"][c];
      (void)child.of(nodes);  // within range
      if (!root.ok()) return;
      GltfNode& other = gltf.nodes[static_cast<size_t>(child.count())];
      if (other.parent >= 0)
        child.fail("node " + std::to_string(child.count()) + " has two parents");
      other.parent = static_cast<int>(i);
      children[i].push_back(static_cast<uint32_t>(child.count()));
    }
  }
  if (!root.ok()) return;  // with two parents below it, the order would have no end
  for (uint32_t i = 0; i < gltf.nodes.size(); ++i) {
    if (gltf.nodes[i].parent < 0) gltf.order.push_back(i);
  }
  for (size_t i = 0; i < gltf.order.size(); ++i) {
    for (const uint32_t child : children[gltf.order[i]]) gltf.order.push_back(child);
  }
  if (gltf.order.size() != gltf.nodes.size()) nodes.fail("children go in a circle");
}

// VRM animations and models name the bones of a person by their nodes.
void parse_human_bones(const Field& root, Gltf& gltf) {
  if (!root.has("extensions")) return;
  const Field extensions = root["extensions"];
  const auto add = [&](const std::string& bone, const Field& entry) {
    (void)entry["node"].of(root["nodes"]);
    if (root.ok())
      gltf.human_bones.emplace_back(bone, static_cast<uint32_t>(entry["node"].count()));
  };
  for (const char* name : {"VRMC_vrm_animation", "VRMC_vrm", "VRM"}) {
    if (!extensions.has(name) || !gltf.human_bones.empty()) continue;
    const Field humanoid = extensions[name]["humanoid"], bones = humanoid["humanBones"];
    if (bones.is_array()) {  // VRM 0
      for (size_t i = 0; i < bones.size() && root.ok(); ++i) add(bones[i]["bone"].text(), bones[i]);
    } else {
      bones.for_each([&](const std::string& bone, const Field& entry) {
        if (root.ok()) add(gltf_excerpt(bone), entry);
      });
    }
  }
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

// Reads accessors of the buffers that the file itself holds. Errors go where the index's do.
class Accessors {
 public:
  Accessors(const Field& root, const Chunks& chunks) : root_(root), chunks_(chunks) {}

  std::vector<float> read(const Field& index, const AccessorShape& shape) {
    std::vector<float> values;
    const Field accessor = index.of(root_["accessors"]);
    if (!index.ok()) return values;
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
    if (!index.ok()) return values;

    const Field view = accessor["bufferView"].of(root_["bufferViews"]);
    if (!index.ok()) return values;
    const std::span<const std::byte> bytes = view_bytes(view);
    if (!index.ok()) return values;
    const size_t element = component->bytes * shape.width;
    const uint64_t stride = view.count_or("byteStride", element),
                   offset = accessor.count_or("byteOffset", 0);
    const uint64_t count = accessor["count"].count();
    if (stride < element || stride > 252)
      view["byteStride"].fail(std::to_string(stride) + ": not within the element's size and 252");
    if (count == 0) accessor["count"].fail("no elements");
    if (!index.ok()) return values;
    if (offset > bytes.size() || bytes.size() - offset < element ||
        (bytes.size() - offset - element) / stride < count - 1) {
      accessor.fail("reaches past the end of its buffer view of " + std::to_string(bytes.size()) +
                    " bytes");
      return values;
    }
    // Counted over the whole animation: many samplers may name one accessor.
    if (count > (kMaxValues - values_read_) / shape.width) {
      accessor["count"].fail("more than 2^26 key values in the animation");
      return values;
    }
    values_read_ += count * shape.width;
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
  std::span<const std::byte> view_bytes(const Field& view) {
    if (view.has("extensions") && view["extensions"].has("EXT_meshopt_compression")) {
      view["extensions"].fail("unsupported: EXT_meshopt_compression");
    }
    const Field buffer = view["buffer"].of(root_["buffers"]);
    if (!view.ok()) return {};
    const uint64_t number = view["buffer"].count();
    std::span<const std::byte> bytes;
    if (buffer.has("uri")) {
      auto [found, is_new] = decoded_.try_emplace(number);
      if (is_new && !decode_data_uri(buffer["uri"].whole_text(), found->second))
        decoded_.erase(found), found = decoded_.end();
      if (found == decoded_.end()) {
        buffer["uri"].fail(
            "unsupported: \"" + gltf_excerpt(buffer["uri"].whole_text(), 40) +
            "\": no other file is opened; save as .glb, or with embedded buffers (data URIs)");
        return {};
      }
      bytes = found->second;
    } else if (number == 0 && chunks_.has_bin) {
      bytes = chunks_.bin;
    } else {
      view["buffer"].fail("unsupported: only the file's own binary chunk and data URIs are read");
      return {};
    }
    const uint64_t buffer_bytes = buffer["byteLength"].count();
    if (buffer_bytes > bytes.size()) {
      buffer["byteLength"].fail(std::to_string(buffer_bytes) + " bytes, there are " +
                                std::to_string(bytes.size()));
    }
    const uint64_t offset = view.count_or("byteOffset", 0), length = view["byteLength"].count();
    if (offset > buffer_bytes || length > buffer_bytes - offset) {
      view.fail("reaches past the end of its buffer of " + std::to_string(buffer_bytes) + " bytes");
    }
    return view.ok() ? bytes.subspan(offset, length) : std::span<const std::byte>();
  }

  Field root_;
  Chunks chunks_;
  std::map<uint64_t, std::vector<std::byte>> decoded_;  // buffers of data URIs
  uint64_t values_read_ = 0;
};

GltfInterpolation interpolation_of(const Field& sampler) {
  if (!sampler.has("interpolation")) return GltfInterpolation::kLinear;
  const std::string name = sampler["interpolation"].text();
  if (name == "STEP") return GltfInterpolation::kStep;
  if (name == "LINEAR") return GltfInterpolation::kLinear;
  if (name == "CUBICSPLINE") return GltfInterpolation::kCubicSpline;
  sampler["interpolation"].fail("\"" + name + "\" is none of STEP, LINEAR and CUBICSPLINE");
  return GltfInterpolation::kLinear;
}

size_t width_of(GltfPath path) { return path == GltfPath::kRotation ? 4 : 3; }

GltfTrack parse_track(const Field& sampler, GltfPath path, Accessors& accessors) {
  GltfTrack track;
  track.path = path;
  track.interpolation = interpolation_of(sampler);
  const Field input = sampler["input"], output = sampler["output"];
  track.times_s = accessors.read(input, {"SCALAR", 1, false});
  for (size_t i = 0; i < track.times_s.size() && input.ok(); ++i) {
    if (!(track.times_s[i] >= 0 && track.times_s[i] <= kMaxTimeS))
      input.fail("key " + std::to_string(i) + ": not within 0 and 1e5 s");
    if (i > 0 && !(track.times_s[i] > track.times_s[i - 1]))
      input.fail("key " + std::to_string(i) + ": not later than the one before");
  }
  const size_t width = width_of(path),
               rows = track.interpolation == GltfInterpolation::kCubicSpline ? 3 : 1;
  track.values =
      accessors.read(output, {width == 4 ? "VEC4" : "VEC3", width, path == GltfPath::kRotation});
  if (!output.ok()) return track;
  if (track.values.size() != track.times_s.size() * rows * width) {
    output.fail(std::to_string(track.values.size() / width) + " values for " +
                std::to_string(track.times_s.size()) + " keys");
    return track;
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

// The path of a channel that moves a node, or none.
const char* const kPaths[] = {"translation", "rotation", "scale"};

void parse_channel(const Field& root, const Field& channel, const Field& samplers,
                   Accessors& accessors, Gltf& gltf) {
  const Field target = channel["target"];
  const std::string name = target["path"].text();
  if (!root.ok() || name == "weights" || name == "pointer" || !target.has("node"))
    return;  // of meshes, or of an extension
  const auto* path = std::find(std::begin(kPaths), std::end(kPaths), name);
  if (path == std::end(kPaths)) {
    return target["path"].fail("\"" + name +
                               "\" is none of translation, rotation, scale and weights");
  }
  const Field node = target["node"].of(root["nodes"]);
  if (!root.ok()) return;
  const uint32_t number = static_cast<uint32_t>(target["node"].count());
  FieldError own;
  if (node.has("matrix")) {
    target.with(own)["node"].fail("node " + std::to_string(number) +
                                  " has a matrix: it cannot be animated");
  }
  GltfTrack track;
  const Field sampler = channel.with(own)["sampler"].of(samplers);
  if (own.ok()) {
    track = parse_track(sampler, static_cast<GltfPath>(path - std::begin(kPaths)), accessors);
  }
  if (own.ok() && std::any_of(gltf.tracks.begin(), gltf.tracks.end(), [&](const GltfTrack& other) {
        return other.node == number && other.path == track.path;
      })) {
    target.with(own).fail("a second channel for the same node and path");
  }
  if (!own.ok()) {
    if (gltf.nodes[number].defect.empty()) gltf.nodes[number].defect = own.text;
    return;
  }
  track.node = number;
  gltf.tracks.push_back(std::move(track));
}

void parse_animation(const Field& root, const Chunks& chunks, Gltf& gltf) {
  if (!root.has("animations")) return root.missing("animations").fail("there are none");
  const Field animations = root["animations"];
  if (animations.size() == 0) animations.fail("there are none");
  if (!root.ok()) return;
  if (gltf.animation >= animations.size()) {
    return animations.fail("no number " + std::to_string(gltf.animation) + ": there are " +
                           std::to_string(animations.size()));
  }
  // What the animations move, whatever else is the matter with those that are not read.
  for (size_t a = 0; a < animations.size(); ++a) {
    FieldError ignored;
    std::vector<uint32_t>& moved = gltf.moved.emplace_back();
    const Field channels = animations[a].with(ignored)["channels"];
    for (size_t c = 0; ignored.ok() && c < channels.size(); ++c) {
      FieldError of_channel;
      const Field target = channels[c].with(of_channel)["target"];
      const uint64_t node = target["node"].count();
      if (of_channel.ok() && node < gltf.nodes.size()) moved.push_back(static_cast<uint32_t>(node));
    }
  }
  const Field animation = animations[gltf.animation], channels = animation["channels"],
              samplers = animation["samplers"];
  Accessors accessors(root, chunks);
  for (size_t c = 0; root.ok() && c < channels.size(); ++c)
    parse_channel(root, channels[c], samplers, accessors, gltf);
}

// A key of a track and its tangents.
struct Key {
  const GltfTrack& track;
  const float* row(size_t key, size_t which) const {  // 0: tangent in, 1: value, 2: tangent out
    const bool cubic = track.interpolation == GltfInterpolation::kCubicSpline;
    return &track.values[(cubic ? key * 3 + which : key) * width_of(track.path)];
  }
};

Vec3 as_value(const float* at, const Vec3&) { return {at[0], at[1], at[2]}; }
Quat as_value(const float* at, const Quat&) { return Quat(at[3], at[0], at[1], at[2]); }
Vec3 times(double a, const Vec3& v) { return a * v; }
Quat times(double a, const Quat& q) { return Quat(a * q.w, a * q.x, a * q.y, a * q.z); }
Vec3 plus(const Vec3& a, const Vec3& b) { return a + b; }
Quat plus(const Quat& a, const Quat& b) { return Quat(a.w + b.w, a.x + b.x, a.y + b.y, a.z + b.z); }
Vec3 finished(const Vec3& v) { return v; }
Quat finished(const Quat& q) {
  // A spline through opposite quaternions may pass through zero: nothing better than no rotation is
  // known there.
  return std::sqrt(dot(q, q)) > 1e-6 ? unit(q) : no_turn();
}
Vec3 mixed(const Vec3& a, double t, const Vec3& b) { return (1 - t) * a + t * b; }
Quat mixed(const Quat& a, double t, const Quat& b) { return slerped(a, t, b); }

// One track at a time; T says what of: Vec3, or Quat (unit).
template <class T>
T value_at(const GltfTrack& track, double time_s) {
  const Key keys{track};
  const auto row = [&](size_t key, size_t which) { return as_value(keys.row(key, which), T()); };
  const auto next = std::upper_bound(track.times_s.begin(), track.times_s.end(), time_s);
  if (next == track.times_s.begin()) return finished(row(0, 1));
  const size_t a = static_cast<size_t>(next - track.times_s.begin()) - 1;
  if (a + 1 == track.times_s.size() || track.interpolation == GltfInterpolation::kStep)
    return finished(row(a, 1));
  const double span_s = double{track.times_s[a + 1]} - double{track.times_s[a]},
               t = (time_s - double{track.times_s[a]}) / span_s;
  if (track.interpolation == GltfInterpolation::kCubicSpline) {
    const double t2 = t * t, t3 = t2 * t;
    return finished(plus(plus(plus(times(2 * t3 - 3 * t2 + 1, row(a, 1)),
                                   times(span_s * (t3 - 2 * t2 + t), row(a, 2))),
                              times(-2 * t3 + 3 * t2, row(a + 1, 1))),
                         times(span_s * (t3 - t2), row(a + 1, 0))));
  }
  return mixed(finished(row(a, 1)), t, finished(row(a + 1, 1)));
}

}  // namespace

std::vector<GltfTransform> Gltf::at(double time_s) const {
  std::vector<GltfTransform> out;
  out.reserve(nodes.size());
  for (const GltfNode& node : nodes) out.push_back(node.rest);
  for (const GltfTrack& track : tracks) {
    GltfTransform& transform = out[track.node];
    if (track.path == GltfPath::kRotation) {
      transform.rotation = unit(value_at<Quat>(track, time_s));
    } else {
      (track.path == GltfPath::kScale ? transform.scale : transform.translation) =
          value_at<Vec3>(track, time_s);
    }
  }
  return out;
}

Result<Gltf> parse_gltf(std::span<const std::byte> bytes, const std::string& where,
                        uint32_t animation) {
  const Result<Chunks> chunks = chunks_of(bytes, where);
  if (!chunks.ok()) return chunks.status();
  const Result<nlohmann::json> json = parse_gltf_json(chunks->json, where);
  if (!json.ok()) return json.status();
  Gltf gltf;
  gltf.where = where;
  gltf.animation = animation;
  FieldError error;
  const Field root(*json, "", error);
  const Field version = root["asset"]["version"];
  if (error.ok() && !version.text().starts_with("2."))
    version.fail("\"" + version.text() + "\": only 2.0 is read");
  if (error.ok()) parse_nodes(root, gltf);
  if (error.ok()) parse_human_bones(root, gltf);
  if (error.ok()) parse_animation(root, *chunks, gltf);
  if (!error.ok()) return Status(StatusCode::kCorrupt, where + ": " + error.text);
  return gltf;
}

}  // namespace figurine::ports
