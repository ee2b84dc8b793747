// One way of drawing what `figurine bench` measures: figures in fresh poses, or a file of Gaussians
// from all around, by a renderer of its own, and what its frames cost.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "samples/common/camera_spec.h"
#include "samples/common/device_options.h"
#include "samples/common/frame_log.h"
#include "samples/common/framing.h"
#include "samples/common/gaussian_scene.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/figurine/roofline.h"

namespace figurine::samples {

// What is drawn.
struct BenchSubject {
  SceneOptions scene;  // of figures, or
  std::string ply;     // a file of Gaussians
  std::string up = "+y";
  std::optional<ImageSize> size;  // else the golden frame's; kSceneSize of Gaussians
  Framing framing = Framing::kBody;
  CameraSpec camera;  // of figures
  OmissionOptions omissions;
  uint32_t frames = 60;  // after which cameras and poses begin anew
};

struct FirstFrame {
  double open_ms = 0, prepare_ms = 0, render_ms = 0;
};

class BenchLane {
 public:
  // precision: none for Gaussians.
  static Result<BenchLane> open(const BenchSubject& subject, RendererOptions renderer,
                                std::optional<Precision> precision, FirstFrame& first);

  ImageSize size() const { return {cameras_[0].width_px, cameras_[0].height_px}; }
  const Scene* figures() const { return scene_.get(); }  // null of Gaussians
  const Approximation& approximation() const { return approximation_; }
  Status render(uint32_t i, RenderedFrame& frame, bool measured);
  SceneSize scene_size() const;
  Isa isa() const { return renderer_->isa(); }
  // An entry of "runs" (docs/json.md).
  nlohmann::ordered_json json() const;

 private:
  std::span<const FrameAvatar> pose(uint32_t i) {
    return scene_->moves() ? scene_->pose(frames_[i % frames_.size()]) : scene_->sway(i);
  }
  Status open_figures(const BenchSubject& subject, const RendererOptions& options,
                      FirstFrame& first);
  Status open_gaussians(const BenchSubject& subject, const RendererOptions& options,
                        FirstFrame& first);

  std::optional<Precision> precision_;
  std::unique_ptr<Renderer> renderer_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<GaussianCloud> cloud_;
  std::vector<uint32_t> frames_;
  std::vector<Camera> cameras_;
  LeaveOut leave_out_;
  Approximation approximation_;
  FrameLog log_;
  uint64_t allocations_ = 0;
};

}  // namespace figurine::samples
