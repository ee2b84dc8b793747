#include "samples/emulator/error_study.h"

#include <algorithm>
#include <limits>

#include "ports/host/clock.h"
#include "samples/common/image_error.h"
#include "samples/common/rendered_frame.h"

namespace figurine::emulator {

namespace {

constexpr int kRounds = 3;  // of a frame that needs none before it; the fastest counts

bool lives_on_earlier_frames(const Settings& settings) {
  return settings.approximation.network_interval > 1 || settings.approximation.network_below_px > 0;
}

bool same_figures(const std::vector<StudyFigure>& a, const std::vector<StudyFigure>& b) {
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(), [](const StudyFigure& x, const StudyFigure& y) {
        return x.avatar == y.avatar && x.body == y.body && x.coarse.avatar == y.coarse.avatar;
      });
}

}  // namespace

// The last frames of a view, and what one of them took.
struct ErrorStudy::Frames {
  std::vector<ports::ImageF32> pictures;
  double ms = 0;
};

Status ErrorStudy::prepare(const StudyView& view) {
  if (renderer_ && isa_ == view.isa && same_figures(figures_, view.figures)) return {};
  renderer_.reset();
  Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 1, .isa = view.isa});
  if (!renderer.ok()) return renderer.status();
  ids_.clear();
  for (const StudyFigure& figure : view.figures) {
    const Result<AvatarId> id =
        (*renderer)->add_avatar(figure.avatar->avatar, figure.body->package);
    if (!id.ok()) return id.status().within(figure.avatar->name);
    ids_.push_back({.avatar = *id, .pose = {}});
    if (!figure.coarse.avatar) continue;
    const Result<AvatarId> coarse =
        (*renderer)->add_avatar(figure.coarse.avatar->avatar, figure.coarse.body->package);
    if (!coarse.ok()) return coarse.status().within(figure.coarse.avatar->name);
    ids_.back().coarse = *coarse;
  }
  renderer_ = std::move(*renderer);
  isa_ = view.isa, figures_ = view.figures;
  return {};
}

// standing: the moment before was this one, for runs of networks that can be spared then.
Result<ErrorStudy::Frames> ErrorStudy::draw(const StudyView& view, const Settings& settings,
                                            bool standing, const std::atomic<bool>& cancelled) {
  samples::RenderedFrame frame({view.camera.width_px, view.camera.height_px},
                               PixelFormat::kRgbaF32);
  std::vector<GaussianView> gaussians;
  if (view.cloud) gaussians.push_back(view.cloud->view());
  const auto render = [&](size_t moment) -> Result<double> {
    if (cancelled) return Status(StatusCode::kInterrupted, "cancelled");
    std::vector<FrameAvatar> posed = ids_;
    for (size_t f = 0; f < ids_.size(); ++f) {
      posed[f].pose = view.moments[moment][f].view();
      posed[f].keep_to_known = settings.keep_to_known;
    }
    const uint64_t start_ns = ports::thread_cpu_ns();
    FIG_RETURN_IF_ERROR(renderer_->render(
        {.camera = view.camera,
         .avatars = posed,
         .gaussians = gaussians,
         .splat = {.antialiased =
                       view.cloud ? std::optional(view.cloud->antialiased) : std::nullopt},
         .leave_out = settings.leave_out,
         .approximation = settings.approximation},
        frame.target()));
    return static_cast<double>(ports::thread_cpu_ns() - start_ns) * 1e-6;
  };
  const size_t now = std::max<size_t>(view.moments.size(), 1) - 1;
  Frames frames;
  if (!lives_on_earlier_frames(settings)) {
    frames.ms = std::numeric_limits<double>::infinity();
    for (int round = standing ? -1 : 0; round < kRounds; ++round) {
      const Result<double> ms = render(now);
      if (!ms.ok()) return ms.status();
      if (round >= 0) frames.ms = std::min(frames.ms, *ms);
    }
    frames.pictures.push_back(frame.f32);
    return frames;
  }
  // A network that has run for the oldest moment, and then as it comes; the frames of a whole round
  // of turns count.
  const size_t counted = std::min<size_t>(settings.approximation.network_interval, now + 1);
  for (size_t moment = 0; moment <= now; ++moment) {
    const Result<double> ms = render(moment);
    if (!ms.ok()) return ms.status();
    if (moment + counted <= now) continue;
    frames.ms += *ms / static_cast<double>(counted);
    frames.pictures.push_back(frame.f32);
  }
  return frames;
}

Result<Study> ErrorStudy::measure(const StudyView& view, const std::atomic<bool>& cancelled) {
  FIG_RETURN_IF_ERROR(prepare(view));
  const Settings dense = dense_settings();
  // Of the moments before as well, as far as anybody compares with them; in order, now first.
  std::vector<ports::ImageF32> truth;
  double dense_ms = 0;
  const auto truth_of = [&](size_t back) -> Result<const ports::ImageF32*> {
    while (truth.size() <= back) {
      StudyView before = view;
      if (!before.moments.empty()) before.moments.resize(before.moments.size() - truth.size());
      Result<Frames> frames = draw(before, dense, false, cancelled);
      if (!frames.ok()) return frames.status();
      if (truth.empty()) dense_ms = frames->ms;
      truth.push_back(std::move(frames->pictures.back()));
    }
    return &truth[back];
  };
  const auto row_of = [&](const Settings& settings, bool standing) -> Result<StudyRow> {
    if (const Result<const ports::ImageF32*> first = truth_of(0); !first.ok())
      return first.status();
    const Result<Frames> frames = draw(view, settings, standing, cancelled);
    if (!frames.ok()) return frames.status();
    samples::ErrorSum sum;
    StudyRow row{.same = true};
    const size_t count = frames->pictures.size();
    for (size_t i = 0; i < count; ++i) {
      const Result<const ports::ImageF32*> wanted = truth_of(count - 1 - i);
      if (!wanted.ok()) return wanted.status();
      row.same = row.same && (*wanted)->pixels == frames->pictures[i].pixels;
      samples::add_foreground_error(**wanted, frames->pictures[i], sum);
    }
    row.error_db = sum.psnr_db();
    row.gain_ms = dense_ms - frames->ms;
    return row;
  };
  Study study{.number = view.number};
  for (const Switch& each : switches()) {
    Settings alone = dense;
    each.set(alone, each.on(view.settings) ? each.get(view.settings) : each.tried);
    const Result<StudyRow> row = row_of(alone, alone.leave_out.unchanged_networks);
    if (!row.ok()) return row.status();
    study.rows.push_back(*row);
  }
  Settings fresh = view.settings;
  fresh.leave_out.unchanged_networks = false;
  const Result<StudyRow> as_set = row_of(fresh, false);
  if (!as_set.ok()) return as_set.status();
  study.as_set = *as_set;
  study.dense_ms = dense_ms;
  return study;
}

}  // namespace figurine::emulator
