// What the comments of a .ply say of how its Gaussians are to be drawn: trainers and editors have
// no other place for it.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

struct PlyDrawing {
  std::optional<bool> antialiased;
  bool flat = false;  // 2D Gaussians: the third scale is to be ignored
  std::optional<UpAxis> up;
};

// In any case of letters, the last one of a kind holds:
//   SplatRenderMode: mip | default | 2dgs   (Brush, SuperSplat)
//   antialiased 1 | 0                       (Postshot), antialiased: ... (figurine)
//   rasterize_mode: antialiased | classic   (gsplat)
//   Vertical axis: x | z                    (Nerfstudio): that axis points up
//   Vertical axis: 0 -1 0                   (Brush): the axis nearest to this vector does
// "Vertical axis: y" says nothing of which way: Brush writes it of scenes that are y-down.
PlyDrawing read_drawing_comments(std::span<const std::string> comments);

}  // namespace figurine::ports
