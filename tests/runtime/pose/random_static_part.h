// A static part of random values over a body: two groups with grids of their own, and the opacity
// in none.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/texel_grid.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

struct RandomStaticPart {
  StaticPart part;
  std::deque<std::vector<int8_t>> values;
  std::deque<std::vector<float>> scales;

  // The body has a multiple of 4 texels a side. Largest values: 1.9 of the shape's, and colours
  // times or through 4.6.
  RandomStaticPart(const Body& body, uint64_t seed) {
    Random random(seed + 2000);
    add_group(body, 0, 10, body.uv_size / 4, 0.01f, random);
    add_group(body, kStaticColour, 3, body.uv_size, 0.008f, random);
  }
  RandomStaticPart(const RandomStaticPart&) = delete;

 private:
  void add_group(const Body& body, uint32_t first, uint32_t channels, uint32_t size, float scale,
                 Random& random) {
    const size_t cells = make_texel_grid(body, size).cell_count();
    std::vector<int8_t>& q = values.emplace_back(cells * channels);
    for (int8_t& value : q)
      value = static_cast<int8_t>(static_cast<int>(random.uniform(0, 255)) - 127);
    std::vector<float>& s = scales.emplace_back(channels);
    for (float& value : s) value = scale * random.uniform(0.5f, 1.5f);
    part.groups.push_back(
        {.first_channel = first, .channels = channels, .grid_size = size, .values = q, .scale = s});
  }
};

}  // namespace figurine::tests
