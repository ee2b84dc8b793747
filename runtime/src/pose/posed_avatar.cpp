#include "runtime/src/pose/posed_avatar.h"

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

#include "runtime/src/pose/maps.h"
#include "runtime/src/pose/visibility.h"

namespace figurine {
namespace {

constexpr uint32_t kBlocksPerTask = 64;

}  // namespace

bool PoseScratch::ensure(uint32_t joints, uint32_t blocks) {
  return transforms.ensure(joints, blocks) && seen.ensure(blocks) && wanted.ensure(blocks);
}

Result<std::unique_ptr<PosedAvatar>> PosedAvatar::create(const Avatar& avatar, const Body& body,
                                                         const BodyBlocks& blocks,
                                                         Precision precision, ThreadPool& pool,
                                                         const KernelTable& kernels) {
  Result<std::unique_ptr<AvatarNetwork>> network =
      AvatarNetwork::create(avatar, body, precision, pool, kernels);
  if (!network.ok()) return network.status();
  std::unique_ptr<PosedAvatar> posed(new (std::nothrow)
                                         PosedAvatar(avatar, body, blocks, pool, kernels));
  if (posed == nullptr) return out_of_memory("an avatar");
  posed->network_ = std::move(network).value();
  FIG_RETURN_IF_ERROR(posed->shape(avatar));
  return posed;
}

// The person's own joints and texels, the latter in blocks.
Status PosedAvatar::shape(const Avatar& avatar) {
  if (avatar.shape.size() > body_.shape_count()) {
    return Status(StatusCode::kCorrupt,
                  "avatar: more shape coefficients than the body has directions");
  }
  const size_t joints = body_.joint_count(), texels = body_.texel_count();
  Buffer<float> position_m;
  if (!joint_position_m_.ensure(joints * 3) || !position_m.ensure(texels * 3) ||
      !canonical_.ensure(blocks_.count())) {
    return out_of_memory("an avatar's joints and texels");
  }
  const std::span<const float> shape =
      avatar.template_mode == TemplateMode::kShaped ? avatar.shape : std::span<const float>();
  shape_body(body_, shape, joint_position_m_.span(joints * 3), position_m.span(texels * 3));
  for (uint32_t block = 0; block < blocks_.count(); ++block) {
    kernels::CanonicalBlock& out = canonical_[block];
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const size_t i = texel_of_lane(block, lane, blocks_.texels());
      for (size_t k = 0; k < 3; ++k) out.position_m[k][lane] = position_m[3 * i + k];
      out.extent_m[lane] = decoding_.spacing_scale * body_.texel_spacing_m[i];
    }
  }
  return {};
}

void PosedAvatar::select_blocks(const kernels::View* view, const LeaveOut& leave_out,
                                PoseScratch& scratch) const {
  const uint32_t count = blocks_.count();
  const GaussianBounds bounds = bounds_of(decoding_);
  const bool all = view == nullptr || !leave_out.hidden_texels ||
                   !(bounds.offset_m < std::numeric_limits<float>::infinity());
  if (!all) {
    pool_.for_each((count + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
      const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask;
      for (uint32_t block = begin; block < std::min(begin + kBlocksPerTask, count); ++block) {
        scratch.seen[block] =
            may_be_seen(canonical_[block], scratch.transforms[block], bounds, *view) ? 1 : 0;
      }
    });
  }
  scratch.wanted_count = 0;
  for (uint32_t block = 0; block < count; ++block) {
    if (all || scratch.seen[block] != 0) scratch.wanted[scratch.wanted_count++] = block;
  }
}

Status PosedAvatar::pose(const PoseView& pose, const kernels::View* view, const LeaveOut& leave_out,
                         PoseScratch& scratch, StageClock& clock) {
  {
    const StageClock::Scope timed(clock, Stage::kSkin);
    scratch.transforms.pose(body_, blocks_, joint_position_m_.span(size_t{3} * body_.joint_count()),
                            pose, pool_, kernels_);
    select_blocks(view, leave_out, scratch);
  }
  if (scratch.wanted_count == 0) return {};
  {
    const StageClock::Scope timed(clock, Stage::kMaps);
    draw_maps(body_, blocks_, scratch.transforms, root_position(body_.mean_skeleton(), pose),
              statistics_, network_->input(), pool_, kernels_);
  }
  const StageClock::Scope timed(clock, Stage::kNetwork);
  return network_->run(scratch.wanted_blocks());
}

uint32_t PosedAvatar::decode(const PoseScratch& scratch, uint32_t block,
                             kernels::GaussianBlock& out) const {
  kernels::DecodeSkinJob job{.head = {},
                             .texels = &canonical_[block],
                             .transforms = &scratch.transforms[block],
                             .offset_scale_m = decoding_.offset_scale_m,
                             .max_offset = decoding_.max_offset == 0
                                               ? std::numeric_limits<float>::infinity()
                                               : decoding_.max_offset,
                             .max_log_scale = decoding_.max_log_scale,
                             .opacity_bias = decoding_.opacity_bias,
                             .sh_values = 3 * sh_coefficients(decoding_.sh_degree),
                             .gaussians = &out};
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    job.head[lane] = network_->head(texel_of_lane(block, lane, blocks_.texels()));
  }
  kernels_.decode_skin(job);
  return std::min(kernels::kLanes, blocks_.texels() - block * kernels::kLanes);
}

uint64_t PosedAvatar::memory_bytes() const {
  return network_->memory_bytes() + joint_position_m_.memory_bytes() + canonical_.memory_bytes();
}

}  // namespace figurine
