#include "figurine/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "runtime/src/base/content_bytes.h"
#include "runtime/src/base/float_mode.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/avatar_identity.h"
#include "runtime/src/pose/posed_avatar.h"
#include "runtime/src/splat/gaussian_blocks.h"
#include "runtime/src/splat/pixel_layout.h"
#include "runtime/src/splat/rasterizer.h"
#include "runtime/src/splat/view.h"

namespace figurine {
namespace {

constexpr uint64_t kMaxGaussians = uint64_t(1) << 28;

Status invalid(const std::string& what) { return Status(StatusCode::kInvalidArgument, what); }

// The words of an error are put together only where there is one: a frame allocates nothing.
Status validate_gaussians(const GaussianView& gaussians, size_t index) {
  const auto where = [&] { return "gaussians[" + std::to_string(index) + "]: "; };
  if (gaussians.sh_degree > kMaxShDegree)
    return invalid(where() + "SH degree " + std::to_string(gaussians.sh_degree) + " is above 3");
  const size_t n = gaussians.count;
  if (gaussians.position_m.size() != 3 * n || gaussians.covariance_factor.size() != 9 * n ||
      gaussians.opacity.size() != n ||
      gaussians.sh.size() != 3 * n * sh_coefficients(gaussians.sh_degree)) {
    return invalid(where() + "the arrays' sizes do not fit the count of " + std::to_string(n));
  }
  return {};
}

Status validate_approximation(const Approximation& approximation) {
  const auto is_size = [](float px) { return px >= 0 && std::isfinite(px); };
  if (!is_size(approximation.network_below_px))
    return invalid("network_below_px: must be finite and not negative");
  if (approximation.network_interval == 0) return invalid("network_interval: must be at least 1");
  if (!is_size(approximation.coarse_below_px))
    return invalid("coarse_below_px: must be finite and not negative");
  if (!(approximation.averted_above >= 0 && approximation.averted_above <= 1))
    return invalid("averted_above: must be in [0, 1]");
  if (approximation.sh_degree > kMaxShDegree)
    return invalid("sh_degree: is above " + std::to_string(kMaxShDegree));
  return {};
}

}  // namespace

const char* network_library() { return "XNNPACK " FIGURINE_XNNPACK_VERSION; }

struct Renderer::Impl {
  Impl(std::shared_ptr<ThreadPool> threads, const RendererOptions& options,
       const KernelTable& table)
      : pool(std::move(threads)),
        now_ns(options.now_ns),
        now_user(options.now_user),
        kernels(table),
        rasterizer(*pool, table) {}

  struct SharedBody {
    const uint32_t* texel;  // where the body's arrays lie tells bodies apart
    BodyBlocks blocks;
  };
  // One is posed and projected before the next, so equal ones are one.
  struct AddedAvatar {
    AvatarId id;
    AvatarIdentity identity;
    std::shared_ptr<SharedBody> body;  // in front of what borrows from it
    std::shared_ptr<PosedAvatar> posed;
  };

  // Fails, or says how many blocks of Gaussians the frame has at most.
  Status validate(const Frame& frame, const ImageTarget& target, uint32_t& blocks) const;
  Status validate_seen(const FrameAvatar& seen) const;
  Status validate_avatar(AvatarId id, const PoseView& pose) const;
  Result<std::shared_ptr<SharedBody>> blocks_of(const Body& body) const;
  Status add(const FrameAvatar& seen, const kernels::View& view, const Frame& frame,
             StageClock& clock, FrameStatistics& statistics);
  // Of another avatar of the body; null if none has it.
  std::shared_ptr<const BodyGrid> grid_of(const SharedBody& body, uint32_t size) const;

  std::vector<AddedAvatar>::const_iterator find(AvatarId id) const;  // end() if there is none
  PosedAvatar& avatar(AvatarId id) const { return *find(id)->posed; }
  // The avatar itself, or the one for when it is small.
  AvatarId choose_detail(const FrameAvatar& seen, const kernels::View& view, const Frame& frame);

  std::shared_ptr<ThreadPool> pool;
  uint64_t (*now_ns)(void* user);
  void* now_user;
  const KernelTable& kernels;
  std::vector<AddedAvatar> avatars;  // ids ascending
  uint32_t next_id = 0;
  PoseScratch scratch;
  GaussianArrays gaussians;  // of pose_avatar()
  Rasterizer rasterizer;
  FrameStatistics statistics;
};

Status Renderer::Impl::validate(const Frame& frame, const ImageTarget& target,
                                uint32_t& blocks) const {
  FIG_RETURN_IF_ERROR(validate_camera(frame.camera));
  FIG_RETURN_IF_ERROR(validate_target(target, frame.camera));
  if (!frame.background && !layout_of(target.format).alpha) {
    return invalid(std::string("image: ") + to_string(target.format) +
                   " has no alpha and needs a background");
  }
  if (!(frame.splat.alpha_cut > 0 && frame.splat.alpha_cut <= 0.5f))
    return invalid("alpha cut: must be above 0 and at most 0.5");
  FIG_RETURN_IF_ERROR(validate_approximation(frame.approximation));
  if (frame.background) {
    for (float channel : *frame.background) {
      if (!std::isfinite(channel)) return invalid("background: must be finite");
    }
  }
  uint64_t gaussian_count = 0, all_blocks = 0;
  for (size_t i = 0; i < frame.avatars.size(); ++i) {
    const FrameAvatar& seen = frame.avatars[i];
    const Status valid = validate_seen(seen);
    if (!valid.ok()) return valid.within("avatars[" + std::to_string(i) + "]");
    const PosedAvatar &fine = avatar(seen.avatar),
                      &coarse = avatar(seen.coarse.value_or(seen.avatar));
    gaussian_count += std::max(fine.body().texel_count(), coarse.body().texel_count());
    all_blocks += std::max(fine.block_count(), coarse.block_count());
  }
  for (size_t i = 0; i < frame.gaussians.size(); ++i) {
    FIG_RETURN_IF_ERROR(validate_gaussians(frame.gaussians[i], i));
    gaussian_count += frame.gaussians[i].count;
    all_blocks += block_count(frame.gaussians[i].count);
  }
  if (gaussian_count > kMaxGaussians) {
    return Status(StatusCode::kLimitExceeded, "frame: " + std::to_string(gaussian_count) +
                                                  " Gaussians, at most " +
                                                  std::to_string(kMaxGaussians));
  }
  blocks = static_cast<uint32_t>(all_blocks);
  return {};
}

Status Renderer::Impl::validate_seen(const FrameAvatar& seen) const {
  FIG_RETURN_IF_ERROR(validate_avatar(seen.avatar, seen.pose));
  return seen.coarse ? validate_avatar(*seen.coarse, seen.pose).within("coarse") : Status();
}

Status Renderer::Impl::validate_avatar(AvatarId id, const PoseView& pose) const {
  if (find(id) == avatars.end()) return invalid("there is no avatar of this id");
  return validate_pose(pose, avatar(id).body().joint_count());
}

std::vector<Renderer::Impl::AddedAvatar>::const_iterator Renderer::Impl::find(AvatarId id) const {
  const auto place =
      std::lower_bound(avatars.begin(), avatars.end(), id,
                       [](const AddedAvatar& added, AvatarId wanted) { return added.id < wanted; });
  return place != avatars.end() && place->id == id ? place : avatars.end();
}

Result<std::shared_ptr<Renderer::Impl::SharedBody>> Renderer::Impl::blocks_of(
    const Body& body) const {
  for (const AddedAvatar& added : avatars) {
    if (added.body->texel == body.texel.data()) return added.body;
  }
  std::shared_ptr<SharedBody> shared(new (std::nothrow) SharedBody{body.texel.data(), {}});
  if (shared == nullptr || !shared->blocks.ensure(body)) return out_of_memory("a body's texels");
  return shared;
}

std::shared_ptr<const BodyGrid> Renderer::Impl::grid_of(const SharedBody& body,
                                                        uint32_t size) const {
  for (const AddedAvatar& added : avatars) {
    const std::shared_ptr<const BodyGrid>& grid = added.posed->grid();
    if (added.body.get() == &body && grid != nullptr && grid->size() == size) return grid;
  }
  return nullptr;
}

AvatarId Renderer::Impl::choose_detail(const FrameAvatar& seen, const kernels::View& view,
                                       const Frame& frame) {
  const float below_px = frame.approximation.coarse_below_px;
  if (!seen.coarse || below_px == 0) return seen.avatar;
  const bool small = avatar(seen.avatar).is_smaller(seen.pose, view, below_px, scratch);
  return small ? *seen.coarse : seen.avatar;
}

Status Renderer::Impl::add(const FrameAvatar& seen, const kernels::View& view, const Frame& frame,
                           StageClock& clock, FrameStatistics& of_frame) {
  const AvatarId shown = choose_detail(seen, view, frame);
  PosedAvatar& posed = avatar(shown);
  const uint32_t sh_degree = std::min(posed.sh_degree(), frame.approximation.sh_degree);
  const Result<NetworkUse> use = posed.pose({.pose = seen.pose,
                                             .avatar = shown,
                                             .keep_to_known = seen.keep_to_known,
                                             .view = &view,
                                             .leave_out = frame.leave_out,
                                             .approximation = frame.approximation},
                                            scratch, clock);
  if (!use.ok()) return use.status();
  const std::span<const uint32_t> wanted = scratch.wanted_blocks();
  rasterizer.add({.blocks = static_cast<uint32_t>(wanted.size()),
                  .sh_degree = sh_degree,
                  .antialiased = frame.splat.antialiased.value_or(posed.antialiased()),
                  .fill_stage = Stage::kDecode},
                 clock, [&](uint32_t i, kernels::GaussianBlock& block) {
                   return posed.decode(scratch, wanted[i], sh_degree, block);
                 });
  of_frame.left_out.hidden_texels += scratch.hidden_texels;
  of_frame.averted_texels += scratch.averted_texels;
  of_frame.pulled_poses += scratch.is_pulled ? 1 : 0;
  of_frame.coarse_avatars += shown != seen.avatar ? 1 : 0;
  of_frame.macs += *use == NetworkUse::kRun ? posed.macs() : 0;
  of_frame.networks += *use == NetworkUse::kRun ? 1 : 0;
  of_frame.stale_networks += *use == NetworkUse::kStale || *use == NetworkUse::kContinued ? 1 : 0;
  of_frame.left_out.unchanged_networks += *use == NetworkUse::kUnchanged ? 1 : 0;
  return {};
}

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::~Renderer() = default;

Result<std::unique_ptr<Renderer>> Renderer::create(const RendererOptions& options) {
  const MemoryReserve reserve;
  if (!reserve.held()) return no_memory();
  const Result<const KernelTable*> kernels =
      kernels_for(options.isa.value_or(supported_isas().back()));
  if (!kernels.ok()) return kernels.status();
  std::shared_ptr<ThreadPool> pool = options.pool;
  if (pool == nullptr) {
    Result<std::shared_ptr<ThreadPool>> own = make_thread_pool(
        {.threads = options.threads, .allow_oversubscription = options.allow_oversubscription});
    if (!own.ok()) return own.status();
    pool = std::move(own).value();
  }
  std::unique_ptr<Impl> impl(new (std::nothrow) Impl(std::move(pool), options, **kernels));
  if (impl == nullptr) return out_of_memory("a renderer");
  std::unique_ptr<Renderer> renderer(new (std::nothrow) Renderer(std::move(impl)));
  if (renderer == nullptr) return out_of_memory("a renderer");
  return renderer;
}

Result<AvatarId> Renderer::add_avatar(const Package& avatar, const Package& body,
                                      std::optional<Precision> precision) {
  const MemoryReserve reserve;
  if (!reserve.held()) return no_memory();
  if (avatar.kind() != PackageKind::kAvatar)
    return Status(StatusCode::kMismatch,
                  std::string("an avatar is wanted, not a ") + to_string(avatar.kind()));
  return add_avatar(avatar.avatar(), body, precision);
}

Result<AvatarId> Renderer::add_avatar(const Avatar& avatar, const Package& body,
                                      std::optional<Precision> precision) {
  const FloatModeScope mode(FloatMode::frame());
  const MemoryReserve reserve(content_bytes(avatar) +
                              2 * sizeof(Impl::AddedAvatar) * (impl_->avatars.size() + 1));
  if (!reserve.held()) return no_memory();
  if (body.kind() != PackageKind::kBody)
    return Status(StatusCode::kMismatch,
                  std::string("a body is wanted, not a ") + to_string(body.kind()));
  FIG_RETURN_IF_ERROR(check_avatar_fits_body(avatar, body));
  if (impl_->next_id == std::numeric_limits<uint32_t>::max())
    return Status(StatusCode::kLimitExceeded, "avatars: no further id");
  const Result<std::shared_ptr<Impl::SharedBody>> shared = impl_->blocks_of(body.body());
  if (!shared.ok()) return shared.status();
  const BodyBlocks& blocks = (*shared)->blocks;
  const Precision held =
      avatar.holds(Precision::kFixedPoint) ? Precision::kFixedPoint : Precision::kFloat32;
  Impl::AddedAvatar added{.id = AvatarId(impl_->next_id),
                          .identity = identify(avatar, body.body(), precision.value_or(held)),
                          .body = *shared,
                          .posed = nullptr};
  for (const Impl::AddedAvatar& other : impl_->avatars) {
    if (other.identity == added.identity) added.posed = other.posed;
  }
  if (added.posed == nullptr) {
    Result<std::unique_ptr<PosedAvatar>> posed = PosedAvatar::create(
        avatar, body.body(), blocks, impl_->grid_of(**shared, avatar.network.input_size),
        precision.value_or(held), *impl_->pool, impl_->kernels);
    if (!posed.ok()) return posed.status();
    added.posed = std::move(posed).value();
  }
  if (!impl_->scratch.ensure(body.body().joint_count(), blocks.count()))
    return out_of_memory("an avatar's pose");
  impl_->avatars.push_back(std::move(added));
  return AvatarId(impl_->next_id++);
}

Status Renderer::remove_avatar(AvatarId avatar) {
  const MemoryReserve messages;  // without one as well: removing frees
  const auto added = impl_->find(avatar);
  if (added == impl_->avatars.end()) return invalid("there is no avatar of this id");
  impl_->avatars.erase(added);
  return {};
}

uint32_t Renderer::threads() const { return impl_->pool->threads(); }

Precision Renderer::precision(AvatarId avatar) const {
  FIG_CHECK(impl_->find(avatar) != impl_->avatars.end(), "an avatar that is there");
  return impl_->avatar(avatar).precision();
}

Status Renderer::render(const Frame& frame, const ImageTarget& target) {
  const FloatModeScope mode(FloatMode::frame());
  const MemoryReserve messages;
  if (!messages.held()) return no_memory();
  Impl& impl = *impl_;
  uint32_t blocks = 0;
  FIG_RETURN_IF_ERROR(impl.validate(frame, target, blocks));
  const kernels::View view = make_view(frame.camera, frame.splat.alpha_cut);
  FIG_RETURN_IF_ERROR(impl.rasterizer.begin(view, frame.leave_out, frame.approximation, blocks));

  StageClock clock(impl.now_ns, impl.now_user);
  FrameStatistics statistics;
  for (const FrameAvatar& seen : frame.avatars) {
    FIG_RETURN_IF_ERROR(impl.add(seen, view, frame, clock, statistics));
  }
  const bool antialiased = frame.splat.antialiased.value_or(false);
  for (const GaussianView& gaussians : frame.gaussians)
    impl.rasterizer.add(gaussians, antialiased, clock);
  impl.rasterizer.draw(target, frame.background, clock);

  statistics.stage_ns = clock.stage_ns();
  impl.rasterizer.report(statistics);
  impl.statistics = statistics;
  return {};
}

Result<GaussianView> Renderer::pose_avatar(AvatarId id, const PoseView& pose) {
  const FloatModeScope mode(FloatMode::frame());
  const MemoryReserve messages;
  if (!messages.held()) return no_memory();
  FIG_RETURN_IF_ERROR(impl_->validate_avatar(id, pose));
  PosedAvatar& posed = impl_->avatar(id);
  const uint32_t count = posed.body().texel_count();
  if (!impl_->gaussians.ensure(count, posed.sh_degree()))
    return out_of_memory("an avatar's Gaussians");
  StageClock clock;
  const Result<NetworkUse> use = posed.pose({.pose = pose}, impl_->scratch, clock);
  if (!use.ok()) return use.status();
  kernels::GaussianBlock block;
  for (uint32_t i = 0; i < posed.block_count(); ++i) {
    const uint32_t lanes = posed.decode(impl_->scratch, i, posed.sh_degree(), block);
    impl_->gaussians.store(block, i, lanes, posed.sh_degree());
  }
  return impl_->gaussians.view(count, posed.sh_degree());
}

Result<std::optional<PoseRarity>> Renderer::pose_rarity(AvatarId id, const PoseView& pose) const {
  const FloatModeScope mode(FloatMode::frame());
  const MemoryReserve messages;
  if (!messages.held()) return no_memory();
  FIG_RETURN_IF_ERROR(impl_->validate_avatar(id, pose));
  return impl_->avatar(id).rarity(pose);
}

Isa Renderer::isa() const { return impl_->kernels.isa; }

const FrameStatistics& Renderer::statistics() const { return impl_->statistics; }

uint64_t Renderer::memory_bytes() const {
  uint64_t bytes = impl_->rasterizer.memory_bytes() + impl_->gaussians.memory_bytes() +
                   impl_->scratch.memory_bytes();
  for (auto added = impl_->avatars.begin(); added != impl_->avatars.end(); ++added) {
    const auto counted = [&](const auto& is_same) {
      return std::any_of(impl_->avatars.begin(), added, is_same);
    };
    if (!counted([&](const auto& other) { return other.body == added->body; }))
      bytes += added->body->blocks.memory_bytes();
    if (!counted([&](const auto& other) { return other.posed == added->posed; }))
      bytes += added->posed->memory_bytes();
    const BodyGrid* const grid = added->posed->grid().get();
    if (grid != nullptr &&
        !counted([&](const auto& other) { return other.posed->grid().get() == grid; }))
      bytes += grid->memory_bytes();
  }
  return bytes;
}

}  // namespace figurine
