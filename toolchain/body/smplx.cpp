#include "toolchain/body/smplx.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ports/host/files.h"
#include "ports/motion/npz.h"
#include "toolchain/body/skin.h"
#include "toolchain/error.h"

namespace figurine::body {
namespace {

constexpr uint32_t kMaxCoefficients = 20;
constexpr size_t kMaxVertices = 1 << 20;
constexpr size_t kMaxDirections = 1024;                          // SMPL-X has 400
constexpr double kLeastSurface_m2 = 0.05, kMostSurface_m2 = 50;  // an adult has 1.9
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

// Before an array is unpacked: a file of a few hundred kB may declare gigabytes.
void check_declared(const ports::NpzFile& file, const std::string& path) {
  const auto most = [&](const char* name, size_t dimension, size_t limit) {
    const std::vector<size_t> shape = value_or_throw(file.declared_shape(name));
    if (shape.size() > dimension && shape[dimension] > limit) {
      throw InputError(path + ": " + name + ": declares " + std::to_string(shape[dimension]) +
                       ", more than " + std::to_string(limit));
    }
  };
  most("v_template", 0, kMaxVertices);
  most("f", 0, 2 * kMaxVertices);
  most("ft", 0, 2 * kMaxVertices);
  most("vt", 0, 2 * kMaxVertices);
  most("shapedirs", 2, kMaxDirections);
}

// A vertex that hangs on no joint would hang on the root.
void check_weights(const ports::NpyArray& weights, size_t vertices, const std::string& where) {
  for (size_t v = 0; v < vertices; ++v) {
    double sum = 0;
    for (uint32_t j = 0; j < kJointCount; ++j) sum += weights.values[v * kJointCount + j];
    if (!(std::abs(sum - 1) < 0.01)) {
      throw InputError(where + ": those of vertex " + std::to_string(v) + " sum to " +
                       std::to_string(sum) + ", not 1");
    }
  }
}

// Faces without area carry no texels: some are an artist's, more than a tenth are no body.
void check_faces(const ports::NpyArray& positions, const ports::NpyArray& faces,
                 const std::string& where) {
  const size_t count = faces.shape[0];
  size_t flat = 0;
  double area_m2 = 0;
  for (size_t f = 0; f < count; ++f) {
    const auto corner = [&](size_t k, size_t i) {
      return positions.values[3 * static_cast<size_t>(faces.values[3 * f + k]) + i];
    };
    double a[3], b[3];
    for (size_t i = 0; i < 3; ++i)
      a[i] = corner(1, i) - corner(0, i), b[i] = corner(2, i) - corner(0, i);
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
                 z = a[0] * b[1] - a[1] * b[0];
    const double area = 0.5 * std::sqrt(x * x + y * y + z * z);
    area_m2 += area;
    flat += area < 1e-12;
  }
  if (count == 0 || flat * 10 > count) {
    throw InputError(where + ": " + std::to_string(flat) + " of " + std::to_string(count) +
                     " faces have no area");
  }
  if (!(area_m2 > kLeastSurface_m2 && area_m2 < kMostSurface_m2))
    throw InputError(where + ": a surface of " + std::to_string(area_m2) + " m2 is no person's");
}

}  // namespace

BodyModel read_smplx(const std::string& path) {
  throw_if_error(ports::check_regular_file(path), "--smplx");
  const ports::NpzFile file = value_or_throw(ports::NpzFile::open(path));
  check_declared(file, path);
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
  check_weights(weights, vertices, where("weights"));
  check_faces(positions, faces, where("f"));
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
  // Rh and Th of fits turn about the origin of the file.
  char origin[64];
  std::snprintf(origin, sizeof origin, "0 %.9g 0", -lowest);
  model.provenance.settings.push_back({"model_origin_m", origin});
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
