// How far a posed surface is stretched and compressed against its rest shape: Green's strain of
// every face, gathered at the vertices.
//
// Strains are symmetric tensors in rest space that vanish along the normal. They know nothing of
// texture coordinates, so they can be added and interpolated across the surface without seams. A
// rigid motion has none; faces without area have no say.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "toolchain/capture/vec.h"

namespace figurine::capture {

struct Strain {
  float xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, zx = 0;
};

inline Strain operator+(const Strain& a, const Strain& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.yz + b.yz, a.zx + b.zx};
}
inline Strain operator*(const Strain& a, float s) {
  return {a.xx * s, a.yy * s, a.zz * s, a.xy * s, a.yz * s, a.zx * s};
}

// a . E b
inline float contract(const Strain& e, Vec3 a, Vec3 b) {
  return e.xx * a.x * b.x + e.yy * a.y * b.y + e.zz * a.z * b.z + e.xy * (a.x * b.y + a.y * b.x) +
         e.yz * (a.y * b.z + a.z * b.y) + e.zx * (a.z * b.x + a.x * b.z);
}

// weight * t t^T
inline Strain outer(Vec3 t, float weight) {
  return {weight * t.x * t.x, weight * t.y * t.y, weight * t.z * t.z,
          weight * t.x * t.y, weight * t.y * t.z, weight * t.z * t.x};
}

class StrainGauge {
 public:
  // rest_m [V,3], triangles [F,3].
  StrainGauge(std::span<const float> rest_m, std::span<const uint32_t> triangles);

  // [V] of a pose, smoothed over the neighbours: skinning weights are painted vertex by vertex,
  // cloth is not. posed_m [V,3] finite. The result is bounded, whatever the pose.
  std::vector<Strain> measure(std::span<const float> posed_m) const;

 private:
  struct Face {
    std::array<uint32_t, 3> vertex;
    Vec3 a, b;            // an orthonormal frame in the rest plane, a along the first edge
    float i11, i12, i22;  // inverse of the upper triangular matrix of the rest edges in that frame
    float area;
  };
  std::vector<Face> faces_;
  std::vector<float> area_;  // [V] of the faces around
  std::vector<uint32_t> neighbour_start_, neighbour_;
};

// The directions of one strain within a tangent plane.
struct Compression {
  float along = 0;   // share of its length that the surface has lost along `direction`, where it
                     // lost most: 0 if nowhere
  float across = 0;  // and along the direction at right angles, 0 <= across <= along < 1
  Vec3 direction;    // unit, in the plane; of no meaning, sign included, where along = across
};

// a, b: an orthonormal frame of the plane.
Compression principal_compression(const Strain& strain, Vec3 a, Vec3 b);

}  // namespace figurine::capture
