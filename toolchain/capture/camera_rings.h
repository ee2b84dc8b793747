// Cameras on rings around a figure, all aimed at one point and far enough away to hold it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "figurine/camera.h"
#include "toolchain/capture/vec.h"

namespace figurine::capture {

struct CameraRingsOptions {
  uint32_t views = 24;
  uint32_t width_px = 512;
  uint32_t height_px = 512;
  float vertical_fov_deg = 30;
  float margin = 0.04f;  // of the image's half size left free around the outermost point
};

struct RingCamera {
  std::string name;  // "C01", ...
  uint32_t number =
      1;  // as in the extrinsics' keys; never 41, which readers of MVHumanNet leave out
  Camera camera;
};

// Up to three rings (below, level, above), azimuths staggered from ring to ring. One distance for
// all: the nearest at which every point of `points` is inside every image with the margin. points:
// places that the figure reaches in any pose, world, at least one.
std::vector<RingCamera> make_camera_rings(const CameraRingsOptions& options,
                                          const std::vector<Vec3>& points);

}  // namespace figurine::capture
