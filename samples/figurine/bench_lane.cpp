#include "samples/figurine/bench_lane.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "ports/host/clock.h"
#include "samples/common/camera_path.h"
#include "samples/common/device_options.h"
#include "samples/figurine/allocation_counter.h"

namespace figurine::samples {

namespace {

double ms_since(uint64_t start_ns) {
  return static_cast<double>(ports::now_ns() - start_ns) * 1e-6;
}

}  // namespace

// From closed files to the first picture, by the golden pose and camera.
Status BenchLane::open_figures(const BenchSubject& subject, const RendererOptions& options,
                               FirstFrame& first) {
  uint64_t start_ns = ports::now_ns();
  SceneOptions wanted = subject.scene;
  wanted.open = OpenOptions::for_drawing(precision_.value_or(Precision::kFixedPoint));
  Result<Scene> scene = Scene::load(wanted);
  if (!scene.ok()) return scene.status();
  scene_ = std::make_unique<Scene>(std::move(*scene));
  first.open_ms = ms_since(start_ns);
  if (scene_->moves())
    approximation_ = subject.omissions.approximation(scene_->frames_per_second());
  start_ns = ports::now_ns();
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(options);
  if (!renderer.ok()) return renderer.status();
  renderer_ = std::move(*renderer);
  FIG_RETURN_IF_ERROR(scene_->add_to(*renderer_, precision_));
  first.prepare_ms = ms_since(start_ns);
  const Camera& camera = scene_->avatar(0).avatar.golden.camera;
  RenderedFrame frame({camera.width_px, camera.height_px}, PixelFormat::kRgba8);
  start_ns = ports::now_ns();
  FIG_RETURN_IF_ERROR(
      renderer_->render({.camera = camera, .avatars = scene_->pose(0)}, frame.target()));
  first.render_ms = ms_since(start_ns);

  Result<std::vector<uint32_t>> frames = scene_->frames({});
  if (!frames.ok()) return frames.status();
  frames_ = std::move(*frames);
  if (frames_.size() > subject.frames) frames_.resize(subject.frames);
  CameraPathOptions path;
  path.camera = subject.camera;
  path.size = subject.size;
  path.framing = subject.framing;
  Result<std::vector<Camera>> cameras = make_camera_path(path, frames_, *scene_, *renderer_);
  if (!cameras.ok()) return cameras.status();
  cameras_ = std::move(*cameras);
  return {};
}

Status BenchLane::open_gaussians(const BenchSubject& subject, const RendererOptions& options,
                                 FirstFrame& first) {
  uint64_t start_ns = ports::now_ns();
  Result<GaussianCloud> cloud = read_scene(subject.ply);
  if (!cloud.ok()) return cloud.status();
  cloud_ = std::make_unique<GaussianCloud>(std::move(*cloud));
  first.open_ms = ms_since(start_ns);
  start_ns = ports::now_ns();
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(options);
  if (!renderer.ok()) return renderer.status();
  renderer_ = std::move(*renderer);
  first.prepare_ms = ms_since(start_ns);

  const ImageSize size = subject.size.value_or(kSceneSize);
  OrbitCamera orbit = orbit_scene(*cloud_, std::nullopt, subject.up, size);
  const float from_deg = orbit.azimuth_deg;
  for (uint32_t i = 0; i < subject.frames; ++i) {
    orbit.azimuth_deg =
        from_deg + 360.0f * static_cast<float>(i) / static_cast<float>(subject.frames);
    const Result<Camera> camera = scene_camera(orbit, subject.up, size);
    if (!camera.ok()) return camera.status();
    cameras_.push_back(*camera);
  }
  RenderedFrame frame(size, PixelFormat::kRgba8);
  const GaussianView gaussians[] = {cloud_->view()};
  start_ns = ports::now_ns();
  FIG_RETURN_IF_ERROR(
      renderer_->render({.camera = cameras_[0], .gaussians = gaussians}, frame.target()));
  first.render_ms = ms_since(start_ns);
  return {};
}

Result<BenchLane> BenchLane::open(const BenchSubject& subject, RendererOptions renderer,
                                  std::optional<Precision> precision, FirstFrame& first) {
  BenchLane lane;
  lane.precision_ = precision;
  lane.leave_out_ = subject.omissions.leave_out();
  lane.leave_out_.unchanged_networks = false;  // a pose that comes again has its run all the same
  lane.approximation_ = subject.omissions.approximation(SwayPoses::kMomentsPerSecond);
  FIG_RETURN_IF_ERROR(subject.ply.empty() ? lane.open_figures(subject, renderer, first)
                                          : lane.open_gaussians(subject, renderer, first));
  return lane;
}

Status BenchLane::render(uint32_t i, RenderedFrame& frame, bool measured) {
  const std::span<const FrameAvatar> posed = scene_ ? pose(i) : std::span<const FrameAvatar>();
  const GaussianView view = cloud_ ? cloud_->view() : GaussianView();
  const std::span<const GaussianView> gaussians(&view, cloud_ ? 1 : 0);
  if (measured) start_counting_allocations();
  const uint64_t start_ns = ports::now_ns();
  const Status status = renderer_->render({.camera = cameras_[i % cameras_.size()],
                                           .avatars = posed,
                                           .gaussians = gaussians,
                                           .leave_out = leave_out_,
                                           .approximation = approximation_},
                                          frame.target());
  const uint64_t total_ns = ports::now_ns() - start_ns;
  if (measured) {
    allocations_ += stop_counting_allocations();
    log_.add(renderer_->statistics(), total_ns);
  }
  return status;
}

SceneSize BenchLane::scene_size() const {
  const uint64_t pixels = uint64_t{size().width_px} * size().height_px;
  if (scene_) return size_of(*scene_, pixels);
  const GaussianView view = cloud_->view();
  return {.gaussian_bytes = view.position_m.size_bytes() + view.covariance_factor.size_bytes() +
                            view.opacity.size_bytes() + view.sh.size_bytes(),
          .pixels = pixels};
}

nlohmann::ordered_json BenchLane::json() const {
  nlohmann::ordered_json json = {
      {"threads", renderer_->threads()},
      {"precision", scene_ ? nlohmann::ordered_json(scene_->precision(*renderer_)) : nullptr}};
  json["frames_per_second"] = 1000 / std::max(log_.total_ms().median, 1e-6);
  json["missed_60hz"] = log_.missed_60hz();
  json["stages_ms"] = log_.stages_json();
  json["work"] = log_.work_json();
  json["allocations_per_frame"] = can_count_allocations()
                                      ? nlohmann::ordered_json(static_cast<double>(allocations_) /
                                                               static_cast<double>(log_.frames()))
                                      : nullptr;
  json["renderer_memory_bytes"] = renderer_->memory_bytes();
  return json;
}

}  // namespace figurine::samples
