// A camera for every frame of a scene: as asked for, following the figures, or framing them.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "figurine/renderer.h"
#include "samples/common/camera_spec.h"
#include "samples/common/framing.h"
#include "samples/common/scene.h"

namespace figurine::samples {

struct CameraPathOptions {
  CameraSpec camera;
  std::optional<ImageSize>
      size;  // without: the JSON camera's, else the golden frame's of the first avatar
  Framing framing = Framing::kBody;  // what an orbit camera aims at, and what has to fit
  bool follow = true;  // orbit cameras move with the figures' smoothed path; otherwise they see the
                       // whole path from one place
  std::optional<float> near_m;
  // What the frames are shown at, for how fast an orbit follows; without: by their distance in the
  // motion.
  std::optional<double> frames_per_second;
  bool turntable = false;  // an orbit goes round once in all frames
};

// An orbit that frames the figures, and what it goes along with.
struct FramedOrbit {
  OrbitCamera orbit;        // its target relative to path
  std::vector<Point> path;  // of each frame; zeros where the orbit stays
};
// options.camera.fixed must be none (FIG_CHECK). Otherwise as make_camera_path().
Result<FramedOrbit> frame_figures(const CameraPathOptions& options,
                                  std::span<const uint32_t> frames, Scene& scene,
                                  Renderer& renderer);

// kUnsupported for a close-up of a body without a head joint, kInvalidArgument for one, or
// a turntable, with a camera that a file fixes. The scene must have been added to the renderer,
// which poses it in a few frames to see how large it is. frames is not empty.
Result<std::vector<Camera>> make_camera_path(const CameraPathOptions& options,
                                             std::span<const uint32_t> frames, Scene& scene,
                                             Renderer& renderer);

}  // namespace figurine::samples
