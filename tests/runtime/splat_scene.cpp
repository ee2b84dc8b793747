#include "runtime/splat_scene.h"

namespace figurine::tests {

Scene make_random_scene(uint32_t count, uint32_t sh_degree, uint64_t seed) {
  Random random(seed);
  Scene scene{.sh_degree = sh_degree};
  for (uint32_t i = 0; i < count; ++i) {
    const float depth = random.uniform(1.5f, 5);
    const std::array<float, 3> place{depth * random.uniform(-0.7f, 0.7f),
                                     depth * random.uniform(-0.7f, 0.7f), depth};
    const float quaternion[4] = {random.normal(), random.normal(), random.normal(),
                                 random.normal()};
    const std::array<float, 9> rotation = rotation_from_quaternion(quaternion);
    // Log-uniform per axis over three decades: from a tenth of a pixel to a fifth of the image,
    // needles included.
    float scale[3];
    for (float& s : scale)
      s = 0.001f * std::pow(300.0f, random.uniform(0, 1) * random.uniform(0, 1));
    std::array<float, 9> factor;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) factor[3 * r + k] = rotation[3 * r + k] * scale[k];
    }
    std::vector<float> sh(3 * sh_coefficients(sh_degree));
    for (size_t k = 0; k < sh.size(); ++k) sh[k] = random.normal() * (k < 3 ? 0.8f : 0.2f);
    scene.add(place, factor, random.uniform(0.02f, 1), sh);
  }
  return scene;
}

}  // namespace figurine::tests
