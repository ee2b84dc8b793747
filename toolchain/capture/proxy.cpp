#include "toolchain/capture/proxy.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "toolchain/body/skin.h"
#include "toolchain/error.h"

namespace figurine::capture {
namespace {

using nlohmann::json;

constexpr uint32_t kBaseVertices = body::MakeHuman::kVertexCount;

// Faces of three.js' JSON model format 3: [flags, vertices, material, texture coordinates]; here
// all are quads with a material and corner UVs (11) or triangles of the same kind (10).
void read_faces(const std::vector<uint32_t>& faces, size_t vertex_count, size_t uv_count,
                Proxy& proxy, const std::string& path) {
  for (size_t i = 0; i < faces.size();) {
    const uint32_t flags = faces[i];
    if (flags != 10 && flags != 11)
      throw InputError(path + ": faces: unknown kind of face " + std::to_string(flags));
    const size_t corners = flags == 11 ? 4 : 3;
    if (i + 2 + 2 * corners > faces.size())
      throw InputError(path + ": faces: the last face is cut off");
    const uint32_t* vertex = &faces[i + 1];
    const uint32_t* uv = vertex + corners + 1;
    for (size_t c = 0; c < corners; ++c) {
      if (vertex[c] >= vertex_count)
        throw InputError(path + ": faces: vertex " + std::to_string(vertex[c]) + " does not exist");
      if (uv[c] >= uv_count)
        throw InputError(path + ": faces: texture coordinate " + std::to_string(uv[c]) +
                         " does not exist");
    }
    for (size_t c = 2; c < corners; ++c) {
      proxy.triangles.insert(proxy.triangles.end(), {vertex[0], vertex[c - 1], vertex[c]});
      proxy.uv_triangles.insert(proxy.uv_triangles.end(), {uv[0], uv[c - 1], uv[c]});
    }
    i += 2 + 2 * corners;
  }
}

void require_finite(const std::vector<float>& values, const char* field, const std::string& path) {
  for (float v : values) {
    if (!std::isfinite(v)) throw InputError(path + ": " + field + ": not a finite number");
  }
}

}  // namespace

Proxy load_proxy(const std::string& directory, const std::string& kind, const std::string& name) {
  const std::string path =
      directory + "/public/data/proxies/" + kind + "/" + name + "/" + name + ".json";
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) throw InputError(file.status().message());
  Proxy proxy;
  proxy.name = name;
  try {
    const auto* text = reinterpret_cast<const char*>(file->bytes().data());
    const json model = json::parse(text, text + file->bytes().size());
    model.at("ref_vIdxs").get_to(proxy.anchors);
    model.at("weights").get_to(proxy.anchor_weights);
    const auto offsets = model.at("offsets").get<std::vector<std::array<float, 3>>>();
    std::vector<float> vertices = model.at("vertices").get<std::vector<float>>();
    proxy.uv = model.at("uvs").at(0).get<std::vector<float>>();
    const size_t count = proxy.anchors.size();
    if (count == 0 || proxy.anchor_weights.size() != count || offsets.size() != count ||
        vertices.size() != 3 * count) {
      throw InputError(path +
                       ": ref_vIdxs, weights, offsets and vertices do not have one entry a vertex");
    }
    if (proxy.uv.size() % 2 != 0) throw InputError(path + ": uvs: not pairs");
    require_finite(vertices, "vertices", path);
    require_finite(proxy.uv, "uvs", path);
    for (size_t i = 1; i < proxy.uv.size(); i += 2)
      proxy.uv[i] = 1 - proxy.uv[i];  // three.js counts v upward
    for (size_t v = 0; v < count; ++v) {
      for (int k = 0; k < 3; ++k) {
        if (proxy.anchors[v][k] >= kBaseVertices)
          throw InputError(path + ": ref_vIdxs: vertex beyond the base mesh");
        if (!std::isfinite(proxy.anchor_weights[v][k]) || !std::isfinite(offsets[v][k]))
          throw InputError(path + ": weights: not finite");
        proxy.offset_m.push_back(offsets[v][k] * body::MakeHuman::kMetresPerUnit);
        proxy.anchor_position_m.push_back((vertices[3 * v + k] - offsets[v][k]) *
                                          body::MakeHuman::kMetresPerUnit);
      }
    }
    read_faces(model.at("faces").get<std::vector<uint32_t>>(), count, proxy.uv.size() / 2, proxy,
               path);
    const json& material = model.at("materials").at(0);
    if (material.contains("mapNormal"))
      proxy.normal_map = directory + "/public/data/proxies/" + kind + "/" + name + "/" +
                         material["mapNormal"].get<std::string>();
    const json& metadata = model.at("metadata");
    if (metadata.contains("deleteVerts")) {
      const auto hidden = metadata["deleteVerts"].get<std::vector<int>>();
      if (hidden.size() != kBaseVertices)
        throw InputError(path + ": metadata.deleteVerts: not one entry a base vertex");
      for (uint32_t v = 0; v < body::MakeHuman::kBodyVertexCount; ++v) {
        if (hidden[v] != 0) proxy.hidden_body_vertices.push_back(v);
      }
    }
  } catch (const json::exception& error) {
    throw InputError(path + ": " + error.what());
  }
  return proxy;
}

namespace {

// Standard deviation of [V,3] points along each axis.
std::array<double, 3> spread(std::span<const float> points) {
  std::array<double, 3> sum{}, square{};
  const double count = static_cast<double>(points.size() / 3);
  for (size_t i = 0; i < points.size(); ++i) {
    sum[i % 3] += points[i];
    square[i % 3] += double{points[i]} * points[i];
  }
  std::array<double, 3> out;
  for (int a = 0; a < 3; ++a)
    out[a] = std::sqrt(std::max(0.0, square[a] / count - sum[a] * sum[a] / (count * count)));
  return out;
}

}  // namespace

Mesh fit_proxy(const Proxy& proxy, std::span<const float> base_vertices_m,
               const body::MakeHuman& makehuman) {
  Mesh mesh;
  mesh.name = proxy.name;
  mesh.triangles = proxy.triangles;
  mesh.uv = proxy.uv;
  mesh.uv_triangles = proxy.uv_triangles;
  const size_t count = proxy.anchors.size();
  mesh.position_m.resize(3 * count);
  for (size_t v = 0; v < count; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      float sum = 0;
      for (int k = 0; k < 3; ++k)
        sum += proxy.anchor_weights[v][k] * base_vertices_m[size_t{proxy.anchors[v][k]} * 3 + axis];
      mesh.position_m[3 * v + axis] = sum;
    }
  }
  const std::array<double, 3> here = spread(mesh.position_m),
                              there = spread(proxy.anchor_position_m);
  for (size_t i = 0; i < mesh.position_m.size(); ++i) {
    const double scale = there[i % 3] > 1e-4 ? here[i % 3] / there[i % 3] : 1.0;
    mesh.position_m[i] += proxy.offset_m[i] * static_cast<float>(scale);
  }
  mesh.skin_joints.resize(count * kSkinInfluences);
  mesh.skin_weights.resize(count * kSkinInfluences);
  for (size_t v = 0; v < count; ++v) {
    body::SkinAccumulator skin;
    double total = 0;
    for (float w : proxy.anchor_weights[v]) total += std::max(0.0f, w);
    for (int k = 0; k < 3; ++k) {
      const double share = std::max(0.0f, proxy.anchor_weights[v][k]) /
                           total;  // the weights sum to 1, so one at least is positive
      const size_t row = size_t{proxy.anchors[v][k]} * kSkinInfluences;
      for (uint32_t i = 0; i < kSkinInfluences; ++i) {
        if (share > 0)
          skin.add(makehuman.skin_joints()[row + i], share * makehuman.skin_weights()[row + i]);
      }
    }
    skin.store(&mesh.skin_joints[v * kSkinInfluences], &mesh.skin_weights[v * kSkinInfluences]);
  }
  return mesh;
}

}  // namespace figurine::capture
