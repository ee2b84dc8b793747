#include "toolchain/verify/parity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/renderer.h"
#include "toolchain/error.h"
#include "toolchain/quantize/quantised_network.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::verify {

namespace {

constexpr float kMidGrey = 0.5f;

struct Errors {
  double sum = 0, largest = 0;
  uint64_t foreground = 0;
  double psnr_db() const {
    if (foreground == 0) return std::numeric_limits<double>::quiet_NaN();
    return sum == 0 ? std::numeric_limits<double>::infinity()
                    : -10 * std::log10(sum / (4.0 * static_cast<double>(foreground)));
  }
};

// trainer: premultiplied; runtime: straight colour. Both [H,W,4].
Errors compare(const std::vector<float>& trainer, const std::vector<float>& runtime) {
  Errors errors;
  for (size_t at = 0; at < trainer.size(); at += 4) {
    const float alpha[2] = {trainer[at + 3], runtime[at + 3]};
    const bool foreground = alpha[0] > 0.5f;
    errors.foreground += foreground;
    for (int c = 0; c < 4; ++c) {
      const double a = c == 3 ? alpha[0] : trainer[at + c] + (1 - alpha[0]) * kMidGrey;
      const double b = c == 3 ? alpha[1] : runtime[at + c] * alpha[1] + (1 - alpha[1]) * kMidGrey;
      const double difference = std::abs(a - b);
      if (!(difference <= errors.largest)) errors.largest = difference;  // NaN sticks
      if (foreground) errors.sum += difference * difference;
    }
  }
  return errors;
}

std::vector<std::pair<size_t, size_t>> choose_views(const dataset::Dataset& data, size_t count) {
  std::vector<std::pair<size_t, size_t>> held_out, chosen;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      const dataset::Role role = data.role(frame, camera);
      if (role != dataset::Role::kTrain && role != dataset::Role::kMissing)
        held_out.emplace_back(frame, camera);
    }
  }
  if (held_out.empty()) throw InputError(data.directory() + ": nothing is held out");
  count = std::min(count, held_out.size());
  for (size_t i = 0; i < count; ++i) chosen.push_back(held_out[i * held_out.size() / count]);
  return chosen;
}

}  // namespace

ParityReport compare_with_runtime(train::TrainedAvatar& avatar, const Avatar& device,
                                  const ParityOptions& options) {
  const std::unique_ptr<Renderer> renderer =
      value_or_throw(Renderer::create({.threads = options.threads}), "runtime");
  const AvatarId id = value_or_throw(
      renderer->add_avatar(device, avatar.body_file().package, options.precision), "runtime");
  train::take_static_part(device.static_part, train::head_layout(avatar.model().settings()),
                          avatar.model().statics());
  if (options.precision == Precision::kFixedPoint && avatar.model().has_network())
    quantize::imitate(device.fixed_point, avatar.model().unet());
  const dataset::Dataset& data = avatar.data();
  ParityReport report;
  Errors pooled;
  report.worst_psnr_db = std::numeric_limits<double>::infinity();
  for (const auto& [frame, camera] : choose_views(data, options.views)) {
    const Camera& view = data.cameras()[camera].camera;
    const train::OwnedPose pose = avatar.model().from_capture(data.frames()[frame]);
    const train::PosedBody posed = avatar.model().pose(pose.view());
    const std::vector<float> trainer =
        avatar.model().render_rgba(avatar.model().evaluate(posed), posed, view);
    std::vector<float> runtime(trainer.size());
    const FrameAvatar seen[] = {{.avatar = id, .pose = pose.view()}};
    const Frame picture{
        .camera = view, .avatars = seen, .gaussians = {}, .background = {}, .splat = {}};
    throw_if_error(renderer->render(picture, {.pixels = runtime.data(),
                                              .stride_bytes = 4 * sizeof(float) * view.width_px,
                                              .format = PixelFormat::kRgbaF32}),
                   "runtime");
    const Errors errors = compare(trainer, runtime);
    report.views.push_back({std::to_string(data.frames()[frame].number),
                            data.cameras()[camera].name, errors.psnr_db(), errors.largest,
                            errors.foreground});
    if (errors.foreground > 0)
      report.worst_psnr_db = std::min(report.worst_psnr_db, errors.psnr_db());
    pooled.sum += errors.sum;
    pooled.foreground += errors.foreground;
    if (!(errors.largest <= pooled.largest)) pooled.largest = errors.largest;
  }
  report.psnr_db = pooled.psnr_db();
  report.largest_error = pooled.largest;
  return report;
}

GoldenRun draw_golden_frame(const Package& avatar, const Package& body) {
  const GoldenFrame& golden = avatar.avatar().golden;
  const Camera& camera = golden.camera;
  GoldenRun run{.library = network_library()};
  std::vector<uint8_t> pixels(size_t(camera.width_px) * camera.height_px * 4);
  for (Precision precision : {Precision::kFloat32, Precision::kFixedPoint}) {
    if (!avatar.avatar().holds(precision)) continue;
    const std::unique_ptr<Renderer> renderer =
        value_or_throw(Renderer::create({.threads = 1}), "runtime");
    const AvatarId id = value_or_throw(renderer->add_avatar(avatar, body, precision), "runtime");
    const FrameAvatar seen[] = {
        {.avatar = id, .pose = {golden.root_translation_m, golden.rotations}}};
    const Frame picture{.camera = camera,
                        .avatars = seen,
                        .gaussians = {},
                        .background = golden.background,
                        .splat = {}};
    throw_if_error(renderer->render(picture, {.pixels = pixels.data(),
                                              .stride_bytes = 4 * size_t(camera.width_px),
                                              .format = PixelFormat::kRgba8}),
                   "runtime");
    run.memory_bytes = std::max(run.memory_bytes, renderer->memory_bytes());
    if (precision == Precision::kFixedPoint) run.fixed_point_hash = hash_picture(pixels);
  }
  return run;
}

}  // namespace figurine::verify
