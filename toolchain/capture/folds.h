// Folds of a garment that come and go with the pose: where the skinned cloth is shorter than at
// rest, it buckles at right angles to the compression, as high as it must to keep its length. A
// height over the coarse mesh, for shading: outlines do not change.
//
// The pattern is a sum of single creases at fixed places of the rest surface. A pose decides only
// how high each one is and which way it lies, both continuous functions of the strain: no state, no
// time, no texture coordinates, hence neither flicker nor seams. What it is not: a cloth
// simulation. Folds do not collide, do not fall with gravity, and do not reach beyond where the
// cloth is compressed.
//
// Based on: Rohmer, Popa, Cani, Hahmann, Sheffer, Animation Wrinkling: Augmenting Coarse Cloth
// Simulations with Realistic-Looking Wrinkles, 2010, sections 4 and 5 (compression field of the
// coarse mesh, wrinkles across it that keep length); Lagae, Lefebvre, Drettakis, Dutre, Procedural
// Noise using Sparse Gabor Convolution, 2009, section 3 (a pattern as a sum of oriented kernels at
// random places).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "toolchain/capture/mesh.h"
#include "toolchain/capture/strain.h"

namespace figurine::capture {

// Which pose's folds a renderer draws. kRest: those of the rest pose in every pose, for measuring
// what the pose's own are worth.
enum class FoldMode : uint8_t { kPose, kRest, kOff };

const char* to_string(FoldMode mode);

struct FoldSample {
  float height_m = 0;  // over the coarse surface
  Vec3 gradient;       // of the height along the surface, no unit: the slope of the folds
};

class FoldPattern {
 public:
  // mesh: its rest shape, triangles and mesh.fold_strength are read and not kept. seed: of the
  // creases' places.
  FoldPattern(const Mesh& mesh, const FoldStyle& style, uint64_t seed);

  // The folds of a pose at every point of the lattice, gradients in rest space. posed_m [V,3].
  std::vector<FoldSample> evaluate(std::span<const float> posed_m) const;

  // Turns the gradients with the surface. linear: [V,9] row-major, the blended transforms' linear
  // parts; length stays, slopes over kSteepest are bent down to it.
  void turn(std::vector<FoldSample>& samples, std::span<const float> linear) const;

  // Of a point of a triangle, linear between the lattice's points.
  FoldSample at(std::span<const FoldSample> samples, uint32_t triangle, float b1, float b2) const;

  float wavelength_m() const { return style_.wavelength_m; }
  size_t crease_count() const { return creases_.size(); }

 private:
  // A triangle of the mesh as a lattice of (n+1)(n+2)/2 points; point (i,j) has barycentric
  // coordinates b1 = i/n, b2 = j/n.
  struct Cell {
    uint32_t first = 0;
    uint32_t n = 1;
    std::array<uint32_t, 3> vertex;
    Vec3 centre;
    float radius = 0;
    uint32_t index(uint32_t i, uint32_t j) const {
      return first + j * (n + 1) - j * (j - 1) / 2 + i;
    }
  };
  struct Crease {
    Vec3 centre, normal, a, b;  // a, b: frame of the tangent plane
    uint32_t triangle;
    float b1, b2;
    float wavelength_m;
    float gain;  // on the height that keeps length: strength of the cloth here, chance, and the
                 // overlap of creases
    uint32_t first_near, end_near = 0;  // into near_
  };
  void place_creases(const Mesh& mesh, const std::vector<float>& normals, uint64_t seed);

  FoldStyle style_;
  StrainGauge gauge_;
  std::vector<Cell> cells_;              // [F]
  std::vector<Vec3> position_, normal_;  // of the lattice's points, rest
  std::vector<Crease> creases_;
  std::vector<uint32_t> near_;  // cells that a crease may reach
};

}  // namespace figurine::capture
