#include "toolchain/body/smplx.h"

#include <algorithm>
#include <cmath>

#include "ports/motion/npz.h"
#include "toolchain/body/skin.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

constexpr uint32_t kMaxCoefficients = 20;
constexpr size_t kMaxVertices = 1 << 20;
constexpr double kMaxCoordinate = 100;  // metres: a file in millimetres is not silently believed

void check_range(const ports::NpyArray& array, double low, double high, const std::string& where) {
  for (size_t i = 0; i < array.values.size(); ++i) {
    if (!(array.values[i] >= low && array.values[i] <= high)) {
      throw InputError(where + ": value " + std::to_string(i) + " is " +
                       std::to_string(array.values[i]) + ", not within " + std::to_string(low) +
                       " and " + std::to_string(high));
    }
  }
}

void check_tree(const ports::NpyArray& table, const std::string& where) {
  // The root's parent is bogus (2^32 - 1 in v1.0): whatever it is, it means -1.
  for (uint32_t j = 0; j < kJointCount; ++j) {
    const bool root = j == 0;
    if (table.values[kJointCount + j] != j || (!root && table.values[j] != joint_parents()[j])) {
      throw InputError(where + ": joint " + std::to_string(j) + ": not the SMPL-X tree");
    }
  }
}

std::vector<uint32_t> indices(const ports::NpyArray& array) {
  std::vector<uint32_t> out(array.values.size());
  std::transform(array.values.begin(), array.values.end(), out.begin(),
                 [](double value) { return static_cast<uint32_t>(value); });
  return out;
}

// regressor [55,V] times one [V,3] array with a stride of `step` values between vertices and
// components.
JointPositions regress(const ports::NpyArray& regressor, const std::vector<double>& values,
                       size_t vertices, size_t first, size_t step) {
  JointPositions joints{};
  for (uint32_t j = 0; j < kJointCount; ++j) {
    double sum[3] = {0, 0, 0};
    for (size_t v = 0; v < vertices; ++v) {
      const double weight = regressor.values[j * vertices + v];
      if (weight == 0) continue;
      for (size_t i = 0; i < 3; ++i) sum[i] += weight * values[first + (v * 3 + i) * step];
    }
    for (int i = 0; i < 3; ++i) joints[3 * j + i] = static_cast<float>(sum[i]);
  }
  return joints;
}

}  // namespace

BodyModel read_smplx(const std::string& path) {
  const ports::NpzFile file = value_or_throw(ports::NpzFile::open(path));
  const auto where = [&](const char* name) { return path + ": " + name; };
  ports::NpyArray positions = value_or_throw(file.read("v_template", {0, 3}));
  const size_t vertices = positions.shape[0];
  if (vertices < 3 || vertices > kMaxVertices)
    throw InputError(where("v_template") + ": " + std::to_string(vertices) + " vertices");
  check_range(positions, -kMaxCoordinate, kMaxCoordinate, where("v_template"));
  const ports::NpyArray faces = value_or_throw(file.read("f", {0, 3}));
  const ports::NpyArray uv_faces = value_or_throw(file.read("ft", {faces.shape[0], 3}));
  const ports::NpyArray uvs = value_or_throw(file.read("vt", {0, 2}));
  const ports::NpyArray directions = value_or_throw(file.read("shapedirs", {vertices, 3, 0}));
  const ports::NpyArray regressor =
      value_or_throw(file.read("J_regressor", {kJointCount, vertices}));
  const ports::NpyArray weights = value_or_throw(file.read("weights", {vertices, kJointCount}));
  check_tree(value_or_throw(file.read("kintree_table", {2, kJointCount})), where("kintree_table"));
  check_range(faces, 0, static_cast<double>(vertices) - 1, where("f"));
  check_range(uv_faces, 0, static_cast<double>(uvs.shape[0]) - 1, where("ft"));
  check_range(uvs, 0, 1, where("vt"));
  check_range(directions, -kMaxCoordinate, kMaxCoordinate, where("shapedirs"));
  check_range(regressor, -1e3, 1e3, where("J_regressor"));
  check_range(weights, 0, 1, where("weights"));
  for (uint32_t j = 0; j < kJointCount; ++j) {
    double sum = 0;
    for (size_t v = 0; v < vertices; ++v) sum += regressor.values[j * vertices + v];
    if (!(std::abs(sum - 1) < 1e-3))
      throw InputError(where("J_regressor") + ": row " + std::to_string(j) + " sums to " +
                       std::to_string(sum) + ", not 1");
  }

  BodyModel model;
  model.name = "smplx";
  double lowest = kMaxCoordinate;
  for (size_t v = 0; v < vertices; ++v) lowest = std::min(lowest, positions.values[3 * v + 1]);
  for (size_t v = 0; v < vertices; ++v) positions.values[3 * v + 1] -= lowest;
  Surface& surface = model.surface;
  surface.position_m.assign(positions.values.begin(), positions.values.end());
  surface.triangles = indices(faces);
  surface.uv_triangles = indices(uv_faces);
  surface.uv.resize(uvs.values.size());
  for (size_t i = 0; i < uvs.values.size(); ++i)
    surface.uv[i] = static_cast<float>(i % 2 == 0 ? uvs.values[i] : 1 - uvs.values[i]);
  surface.hidden.assign(surface.triangle_count(), 0);
  surface.skin_joints.resize(vertices * kSkinInfluences);
  surface.skin_weights.resize(vertices * kSkinInfluences);
  for (size_t v = 0; v < vertices; ++v) {
    SkinAccumulator skin;
    for (uint32_t j = 0; j < kJointCount; ++j) skin.add(j, weights.values[v * kJointCount + j]);
    skin.store(&surface.skin_joints[v * kSkinInfluences],
               &surface.skin_weights[v * kSkinInfluences]);
  }
  model.joint_m = regress(regressor, positions.values, vertices, 0, 1);

  const size_t all = directions.shape[2];
  if (all == 0) throw InputError(where("shapedirs") + ": no shape directions");
  model.shape_count =
      static_cast<uint32_t>(std::min<size_t>(kMaxCoefficients, all <= 20 ? (all + 1) / 2 : all));
  for (size_t s = 0; s < model.shape_count; ++s) {
    for (size_t i = 0; i < vertices * 3; ++i)
      model.vertex_shape_basis_m.push_back(static_cast<float>(directions.values[i * all + s]));
    const JointPositions joints = regress(regressor, directions.values, vertices, s, all);
    model.joint_shape_basis_m.insert(model.joint_shape_basis_m.end(), joints.begin(), joints.end());
  }
  model.provenance.sources = {
      "SMPL-X model file supplied by the user; its licence forbids redistribution"};
  model.provenance.licence_name = "SMPL-X model licence (not redistributable)";
  model.provenance.licence_url = "https://smpl-x.is.tue.mpg.de/modellicense.html";
  model.provenance.avatar_permission = "onlyAuthor";
  model.provenance.commercial_usage = "personalNonProfit";
  model.provenance.depicted_person = "synthetic";
  return model;
}

}  // namespace figurine::body
