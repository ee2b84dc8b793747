// One camera for every frame of a cast: as asked for, following the figures, or framing them by
// itself.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "figurine/renderer.h"
#include "samples/figurine/camera_spec.h"
#include "samples/figurine/cast.h"

namespace figurine::samples {

struct RigOptions {
  CameraSpec camera;
  std::optional<ImageSize>
      size;            // without: the JSON camera's, else the golden frame's of the first avatar
  bool follow = true;  // orbit cameras move with the figures' smoothed path; otherwise they see the
                       // whole path from one place
  std::optional<float> near_m;
};

// The cast must have been added to the renderer, which poses it in a few frames to see how large it
// is. frames is not empty.
Result<std::vector<Camera>> place_cameras(const RigOptions& options,
                                          std::span<const uint32_t> frames, Cast& cast,
                                          Renderer& renderer);

}  // namespace figurine::samples
