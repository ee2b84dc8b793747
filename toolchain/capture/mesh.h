// What the renderer draws: skinned meshes with a material each, and a person as a list of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "toolchain/capture/texture.h"

namespace figurine::capture {

enum class Surfacing : uint8_t { kCloth, kSkin, kHair, kLeather, kEye };

struct Material {
  std::shared_ptr<const Texture> colour;
  std::shared_ptr<const Texture> normal;  // tangent space, or none
  Vec3 tint{1, 1, 1};                     // multiplies the colour, linear light
  Surfacing surfacing = Surfacing::kCloth;
  bool casts_shadow = true;  // lashes and brows lie on the skin and would only darken it
};

// How a cloth folds.
struct FoldStyle {
  float wavelength_m = 0.03f;  // from fold to fold, mean
  float slack = 0.015f;  // share by which the cloth is cut longer than what it covers: it gathers
                         // where it hangs
  float strength = 1;    // 0: does not fold
};

class FoldPattern;

// Rest pose; letters as in body/surface.h. Vertices are shared across texture seams, so that
// normals are smooth there.
struct Mesh {
  std::string name;
  std::vector<float> position_m;       // [V,3]
  std::vector<uint32_t> triangles;     // [F,3]
  std::vector<float> uv;               // [U,2] v down
  std::vector<uint32_t> uv_triangles;  // [F,3]
  std::vector<uint8_t> skin_joints;    // [V,K]
  std::vector<float> skin_weights;     // [V,K]
  Material material;
  std::vector<float> fold_strength;          // [V] 0 .. 1; empty: no folds
  std::shared_ptr<const FoldPattern> folds;  // of this very mesh, or none

  uint32_t vertex_count() const { return static_cast<uint32_t>(position_m.size() / 3); }
  uint32_t triangle_count() const { return static_cast<uint32_t>(triangles.size() / 3); }
};

struct Person {
  std::vector<Mesh> meshes;
  std::vector<float> shape;  // [S] coefficients of the body package nearest to this person
  double shape_error_m = 0;  // mean distance of the person's texels to what the coefficients give
  std::vector<std::pair<std::string, std::string>>
      description;  // "outfit" -> "male_casualsuit03", ...
};

}  // namespace figurine::capture
