// Renders a posed person by ray tracing: a key light with cast shadows, a sky with ambient
// occlusion, a weak fill, all fixed in the world.
//
// What it is: reference photographs for training, so no noise (every random choice is a fixed
// pattern), samples averaged as they are stored (sRGB-encoded, premultiplied), soft alpha, layers
// of transparent hair composited in order. What it is not: global illumination, ground, lens.
// Ambient light is gathered once per pose at the vertices and shared by all cameras; key-light
// shadows are traced per sample.
//
// Based on: Wald et al., Embree: A Kernel Framework for Efficient CPU Ray Tracing, 2014; Hanika,
// Hacking the Shadow Terminator, Ray Tracing Gems II, 2021, chapter 4 (origins of shadow rays).
// Skin's softened terminator is a wrapped cosine, not a measured scattering profile.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "figurine/camera.h"
#include "figurine/pose.h"
#include "ports/media/image.h"
#include "toolchain/capture/folds.h"
#include "toolchain/capture/mesh.h"

namespace figurine::capture {

struct Rendering {
  ports::ImageU8 colour;  // RGB, sRGB-encoded, premultiplied (composited on black)
  ports::ImageU8 alpha;   // grey, coverage
};

// One person, any number of poses. Renderers of different threads share nothing.
class Renderer {
 public:
  explicit Renderer(const Person& person, FoldMode folds = FoldMode::kPose);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  // Skins the meshes, builds the acceleration structure and gathers ambient light: about half a
  // second.
  void set_pose(std::span<const Affine> world_from_rest);
  // The posed vertices' bounds, for framing and for leaving out empty pixels.
  struct Bounds {
    Vec3 low, high;
  };
  Bounds bounds() const;

  Rendering render(const Camera& camera) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace figurine::capture
