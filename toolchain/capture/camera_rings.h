// Cameras on rings around a figure: rings far enough away to hold all of it, and a ring that is
// near to its head and shoulders.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "figurine/camera.h"
#include "toolchain/capture/vec.h"
#include "toolchain/dataset/dataset.h"

namespace figurine::capture {

struct CameraRingsOptions {
  uint32_t views = 24;
  uint32_t bust_views = 0;  // of head and shoulders, beside them
  float bust_scale = 1;     // of their images' sides over the others'
  uint32_t width_px = 512;
  uint32_t height_px = 512;
  float vertical_fov_deg = 30;
  float margin = 0.04f;  // of the image's half size left free around the outermost point
};

struct RingCamera {
  std::string name;  // "C01", ...; of head and shoulders "B25", ...
  uint32_t number =
      1;  // as in the extrinsics' keys; never 41, which readers of MVHumanNet leave out
  Camera camera;
  dataset::Framing framing = dataset::Framing::kBody;
};

// Body: up to three rings (below, level, above), azimuths staggered from ring to ring, all aimed at
// the middle of the figure's height. One distance for all: the nearest at which every point of
// `points` is inside every image with the margin. points: places that the figure reaches in any
// pose, world, at least one.
//
// Bust: one ring behind them in the list, by turns a little below and above eye level, with the
// same lens, as the layout has one for all cameras (intrinsics go with the size of the image). It
// stands still like a real one: at the nearest distance at which 98 % of bust_points are inside the
// images, so that a pose with the head far from where it mostly is may be cut or left out.
// bust_points: where head and shoulders are in any pose; at least one if options.bust_views > 0.
std::vector<RingCamera> make_camera_rings(const CameraRingsOptions& options,
                                          const std::vector<Vec3>& points,
                                          const std::vector<Vec3>& bust_points = {});

}  // namespace figurine::capture
