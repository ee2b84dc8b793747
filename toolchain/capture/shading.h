// The light of the captures and how surfaces answer it. Linear light in, linear light out; no
// geometry, no rays.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "toolchain/capture/mesh.h"
#include "toolchain/capture/vec.h"

namespace figurine::capture {

// Fixed in the world, so that a person's look depends on where they turn. +z is the front, +x the
// left of a figure at heading 0.
struct Lighting {
  Vec3 key_direction = normalized({0.52f, 0.74f, 0.62f});  // towards the light
  Vec3 key_colour{1.12f, 1.02f, 0.88f};  // irradiance of a surface that faces it, divided by pi
  float key_radius = 0.035f;  // of the light's disc, seen from the figure: tan of 2 degrees
  Vec3 sky_colour{0.46f, 0.515f, 0.59f};     // from straight above
  Vec3 ground_colour{0.25f, 0.225f, 0.20f};  // from straight below
  float bounce =
      0.25f;  // what an occluded direction still brings: light that the figure itself reflects
  Vec3 fill_direction = normalized({-0.75f, 0.25f, -0.45f});
  Vec3 fill_colour{0.11f, 0.13f, 0.165f};  // casts no shadow
};

inline Vec3 sky_radiance(const Lighting& light, Vec3 direction) {
  return mix(light.ground_colour, light.sky_colour, 0.5f + 0.5f * direction.y);
}

struct SurfacePoint {
  Vec3 albedo;
  Vec3 normal;   // unit, on the viewer's side
  Vec3 to_view;  // unit
  Vec3 ambient;  // gathered irradiance, divided by pi
  Surfacing surfacing = Surfacing::kCloth;
};

struct Gloss {
  float reflectance;  // at normal incidence
  float roughness;
};

inline Gloss gloss_of(Surfacing surfacing) {
  switch (surfacing) {
    case Surfacing::kSkin:
      return {0.028f, 0.48f};
    case Surfacing::kHair:
      return {0.035f, 0.42f};
    case Surfacing::kLeather:
      return {0.040f, 0.38f};
    case Surfacing::kEye:
      return {0.030f, 0.12f};
    case Surfacing::kCloth:
      break;
  }
  return {0, 1};
}

// How far past the terminator skin still glows: light that scattered below the surface, red
// furthest.
inline Vec3 wrap_of(Surfacing surfacing) {
  return surfacing == Surfacing::kSkin   ? Vec3{0.24f, 0.11f, 0.07f}
         : surfacing == Surfacing::kHair ? Vec3{0.2f, 0.2f, 0.2f}
                                         : Vec3{};
}

// GGX lobe with the visibility term of Karis and Lazarov's mobile approximation.
inline float specular(const Gloss& gloss, Vec3 normal, Vec3 to_view, Vec3 to_light) {
  if (gloss.reflectance <= 0) return 0;
  const Vec3 half = normalized(to_view + to_light);
  const float nh = std::max(dot(normal, half), 0.0f), lh = std::max(dot(to_light, half), 0.1f);
  const float a = gloss.roughness * gloss.roughness, a2 = a * a;
  const float d = nh * nh * (a2 - 1) + 1;
  return gloss.reflectance * a2 / (d * d * 4 * lh * lh * (gloss.roughness + 0.5f));
}

// visible: the share of the key light's disc that is seen, 0 to 1.
inline Vec3 shade(const Lighting& light, const SurfacePoint& p, float visible) {
  const float nl = dot(p.normal, light.key_direction);
  const Vec3 wrap = wrap_of(p.surfacing);
  const auto lit = [&](float w) { return std::max(nl + w, 0.0f) / (1 + w); };
  const Vec3 key = light.key_colour * Vec3{lit(wrap.x), lit(wrap.y), lit(wrap.z)} * visible;
  const Vec3 fill =
      light.fill_colour * std::max(0.5f + 0.5f * dot(p.normal, light.fill_direction), 0.0f);
  Vec3 out = p.albedo * (key + fill + p.ambient);
  if (nl > 0)
    out +=
        light.key_colour *
        (specular(gloss_of(p.surfacing), p.normal, p.to_view, light.key_direction) * nl * visible);
  return out;
}

// A soft shoulder above 0.75, so that bright cloth keeps its texture instead of clipping.
inline float shoulder(float x) {
  constexpr float kKnee = 0.75f, kRoom = 1 - kKnee;
  return x <= kKnee ? x : kKnee + kRoom * (1 - std::exp(-(x - kKnee) / kRoom));
}

}  // namespace figurine::capture
