#include "figurine/renderer.h"

#include <cmath>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "runtime/src/base/stage_clock.h"
#include "runtime/src/pose/posed_avatar.h"
#include "runtime/src/splat/rasterizer.h"

namespace figurine {
namespace {

constexpr uint64_t kMaxGaussians = uint64_t(1) << 28;

Status invalid(const std::string& what) { return Status(StatusCode::kInvalidArgument, what); }

Status validate_target(const ImageTarget& target, const Camera& camera) {
  if (target.format != PixelFormat::kRgba8 && target.format != PixelFormat::kRgbaF32)
    return invalid("image: unknown pixel format");
  const size_t pixel_bytes = target.format == PixelFormat::kRgba8 ? 4 : 4 * sizeof(float);
  if (target.pixels == nullptr) return invalid("image: no pixels");
  if (target.stride_bytes < pixel_bytes * camera.width_px) {
    return invalid("image: rows of " + std::to_string(target.stride_bytes) +
                   " bytes are too short for " + std::to_string(camera.width_px) + " pixels");
  }
  if (target.format == PixelFormat::kRgbaF32 &&
      (target.stride_bytes % alignof(float) != 0 ||
       reinterpret_cast<uintptr_t>(target.pixels) % alignof(float) != 0)) {
    return invalid("image: float pixels must be aligned to 4 bytes");
  }
  return {};
}

// An error of array[index]. Its text is made where there is an error: a sound frame allocates none.
Status within(const Status& status, const char* array, size_t index) {
  if (status.ok()) return {};
  return status.within(std::string(array) + "[" + std::to_string(index) + "]");
}

Status validate_gaussians(const GaussianView& gaussians) {
  if (gaussians.sh_degree > kMaxShDegree)
    return invalid("SH degree " + std::to_string(gaussians.sh_degree) + " is above 3");
  const size_t n = gaussians.count;
  if (gaussians.position_m.size() != 3 * n || gaussians.covariance_factor.size() != 9 * n ||
      gaussians.opacity.size() != n ||
      gaussians.sh.size() != 3 * n * sh_coefficients(gaussians.sh_degree)) {
    return invalid("the arrays' sizes do not fit the count of " + std::to_string(n));
  }
  return {};
}

}  // namespace

const char* network_library() { return "XNNPACK " FIGURINE_XNNPACK_VERSION; }

struct Renderer::Impl {
  Impl(ThreadPool&& threads, uint64_t (*clock)())
      : pool(std::move(threads)), now_ns(clock), rasterizer(pool) {}

  Status validate(const Frame& frame, const ImageTarget& target, uint64_t& gaussian_count) const {
    FIG_RETURN_IF_ERROR(validate_camera(frame.camera));
    FIG_RETURN_IF_ERROR(validate_target(target, frame.camera));
    if (!(frame.splat.alpha_cut > 0 && frame.splat.alpha_cut <= 0.5f))
      return invalid("alpha cut: must be above 0 and at most 0.5");
    if (frame.background) {
      for (float channel : *frame.background) {
        if (!std::isfinite(channel)) return invalid("background: must be finite");
      }
    }
    gaussian_count = 0;
    for (size_t i = 0; i < frame.avatars.size(); ++i) {
      FIG_RETURN_IF_ERROR(
          within(validate_avatar(frame.avatars[i].avatar, frame.avatars[i].pose), "avatars", i));
      gaussian_count += avatars[static_cast<size_t>(frame.avatars[i].avatar)]->body().texel_count();
    }
    for (size_t i = 0; i < frame.gaussians.size(); ++i) {
      FIG_RETURN_IF_ERROR(within(validate_gaussians(frame.gaussians[i]), "gaussians", i));
      gaussian_count += frame.gaussians[i].count;
    }
    if (gaussian_count > kMaxGaussians) {
      return Status(StatusCode::kLimitExceeded, "frame: " + std::to_string(gaussian_count) +
                                                    " Gaussians, at most " +
                                                    std::to_string(kMaxGaussians));
    }
    return {};
  }

  Status validate_avatar(AvatarId id, const PoseView& pose) const {
    if (static_cast<size_t>(id) >= avatars.size()) return invalid("no avatar of this id was added");
    return validate_pose(pose, avatars[static_cast<size_t>(id)]->body().joint_count());
  }

  Result<GaussianView> pose_avatar(AvatarId id, const PoseView& pose, StageClock& clock) {
    PosedAvatar& avatar = *avatars[static_cast<size_t>(id)];
    FIG_RETURN_IF_ERROR(avatar.pose(pose, gaussians, clock));
    return gaussians.view(avatar.body().texel_count(), avatar.sh_degree());
  }

  ThreadPool pool;
  uint64_t (*now_ns)();
  std::vector<std::unique_ptr<PosedAvatar>> avatars;
  GaussianArrays gaussians;  // of one avatar at a time
  Rasterizer rasterizer;
  FrameStatistics statistics;
};

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::~Renderer() = default;

Result<std::unique_ptr<Renderer>> Renderer::create(const RendererOptions& options) {
  Result<ThreadPool> pool = ThreadPool::create(options.threads);
  if (!pool.ok()) return pool.status();
  std::unique_ptr<Impl> impl(new (std::nothrow) Impl(std::move(pool).value(), options.now_ns));
  if (impl == nullptr) return out_of_memory("a renderer");
  std::unique_ptr<Renderer> renderer(new (std::nothrow) Renderer(std::move(impl)));
  if (renderer == nullptr) return out_of_memory("a renderer");
  return renderer;
}

Result<AvatarId> Renderer::add_avatar(const Package& avatar, const Package& body,
                                      std::optional<Precision> precision) {
  if (avatar.kind() != PackageKind::kAvatar)
    return Status(StatusCode::kMismatch,
                  std::string("an avatar is wanted, not a ") + to_string(avatar.kind()));
  return add_avatar(avatar.avatar(), body, precision);
}

Result<AvatarId> Renderer::add_avatar(const Avatar& avatar, const Package& body,
                                      std::optional<Precision> precision) {
  if (body.kind() != PackageKind::kBody)
    return Status(StatusCode::kMismatch,
                  std::string("a body is wanted, not a ") + to_string(body.kind()));
  FIG_RETURN_IF_ERROR(check_avatar_fits_body(avatar, body));
  const Precision held =
      avatar.holds(Precision::kFixedPoint) ? Precision::kFixedPoint : Precision::kFloat32;
  Result<std::unique_ptr<PosedAvatar>> posed =
      PosedAvatar::create(avatar, body.body(), precision.value_or(held), impl_->pool);
  if (!posed.ok()) return posed.status();
  if (!impl_->gaussians.ensure(body.body().texel_count(), (*posed)->sh_degree()))
    return out_of_memory("an avatar's Gaussians");
  impl_->avatars.push_back(std::move(posed).value());
  return AvatarId(impl_->avatars.size() - 1);
}

Precision Renderer::precision(AvatarId avatar) const {
  FIG_CHECK(static_cast<size_t>(avatar) < impl_->avatars.size(), "an avatar that was added");
  return impl_->avatars[static_cast<size_t>(avatar)]->precision();
}

Status Renderer::render(const Frame& frame, const ImageTarget& target) {
  Impl& impl = *impl_;
  uint64_t gaussian_count = 0;
  FIG_RETURN_IF_ERROR(impl.validate(frame, target, gaussian_count));
  FIG_RETURN_IF_ERROR(impl.rasterizer.begin(frame.camera, frame.splat.alpha_cut,
                                            static_cast<uint32_t>(gaussian_count)));

  StageClock clock(impl.now_ns);
  FrameStatistics statistics;
  for (const FrameAvatar& seen : frame.avatars) {
    const Result<GaussianView> gaussians = impl.pose_avatar(seen.avatar, seen.pose, clock);
    if (!gaussians.ok()) return gaussians.status();
    impl.rasterizer.add(*gaussians, clock);
    statistics.macs += impl.avatars[static_cast<size_t>(seen.avatar)]->macs();
  }
  for (const GaussianView& gaussians : frame.gaussians) impl.rasterizer.add(gaussians, clock);
  impl.rasterizer.draw(target, frame.background, clock);

  statistics.stage_ns = clock.stage_ns();
  statistics.gaussians = impl.rasterizer.gaussians();
  statistics.visible = impl.rasterizer.visible();
  statistics.pairs = impl.rasterizer.pairs();
  statistics.blends = impl.rasterizer.blends();
  impl.statistics = statistics;
  return {};
}

Result<GaussianView> Renderer::pose_avatar(AvatarId avatar, const PoseView& pose) {
  FIG_RETURN_IF_ERROR(impl_->validate_avatar(avatar, pose));
  StageClock clock(nullptr);
  return impl_->pose_avatar(avatar, pose, clock);
}

const FrameStatistics& Renderer::statistics() const { return impl_->statistics; }

uint64_t Renderer::memory_bytes() const {
  uint64_t bytes = impl_->rasterizer.memory_bytes() + impl_->gaussians.memory_bytes();
  for (const std::unique_ptr<PosedAvatar>& avatar : impl_->avatars) bytes += avatar->memory_bytes();
  return bytes;
}

}  // namespace figurine
