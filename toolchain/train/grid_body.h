// A body seen at a coarser grid: what draw_pose_maps draws of it is the network's input there.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/body.h"

namespace figurine::train {

// The cells of a grid as texels: each has what its source texel has, and the grid's own border.
// For a grid of the texels themselves nothing is copied.
class GridBody {
 public:
  // body is borrowed; size must fit (grid_fits).
  GridBody(const Body& body, uint32_t size);
  GridBody(const GridBody&) = delete;
  GridBody& operator=(const GridBody&) = delete;

  // Joints, texels and border: what maps are drawn from. Without shape directions of texels.
  const Body& view() const { return view_; }

 private:
  std::vector<uint32_t> texel_, border_texel_, border_source_;
  std::vector<float> position_m_, normal_, weights_, spacing_m_;
  std::vector<uint8_t> joints_;
  Body view_;
};

}  // namespace figurine::train
