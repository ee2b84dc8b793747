// What every switch is worth in the picture at hand: its error against the dense frame, which
// computes everything, and the milliseconds that it saves of it, each switch alone; and the same of
// all as they are set. By a renderer of its own, on one thread, so that it can run beside the one
// whose picture is seen; times are what that thread had of a CPU.
//
// Errors are of floats over the pixels that show somebody (docs/numerics.md, "Picture quality").
// Switches that live on earlier frames (runs of networks) are tried on the moments before this one.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "figurine/renderer.h"
#include "ports/gaussians/gaussian_cloud.h"
#include "samples/common/loading.h"
#include "samples/common/pose_json.h"
#include "samples/common/scene.h"
#include "samples/emulator/switches.h"

namespace figurine::emulator {

struct StudyFigure {
  std::shared_ptr<samples::LoadedAvatar> avatar;
  std::shared_ptr<samples::LoadedPackage> body;
  samples::Scene::Coarse coarse;
};

// A picture to try the switches on; owns all that it needs.
struct StudyView {
  static constexpr size_t kMoments = 16;  // at most, the last of them now

  uint64_t number = 0;  // given back with the result
  std::vector<StudyFigure> figures;
  std::vector<std::vector<samples::StoredPose>> moments;  // [moment][figure]
  std::shared_ptr<const ports::GaussianCloud> cloud;
  Camera camera;
  Settings settings;
  std::optional<Isa> isa;
};

struct StudyRow {
  bool same = false;    // to the bit
  double error_db = 0;  // PSNR to the dense frame, if not the same
  double gain_ms = 0;   // of the dense frame's time
};

struct Study {
  uint64_t number = 0;
  double dense_ms = 0;
  std::vector<StudyRow> rows;  // of switches(), at the value that is set or else tried
  StudyRow as_set;             // every frame with a fresh pose
};

class ErrorStudy {
 public:
  // kInterrupted once cancelled is true; errors of renderers.
  Result<Study> measure(const StudyView& view, const std::atomic<bool>& cancelled);

 private:
  struct Frames;
  Status prepare(const StudyView& view);
  Result<Frames> draw(const StudyView& view, const Settings& settings, bool standing,
                      const std::atomic<bool>& cancelled);

  std::unique_ptr<Renderer> renderer_;
  std::optional<Isa> isa_;
  std::vector<StudyFigure> figures_;
  std::vector<FrameAvatar> ids_;  // their identities; poses are the views'
};

}  // namespace figurine::emulator
