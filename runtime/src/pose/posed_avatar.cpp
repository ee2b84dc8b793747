#include "runtime/src/pose/posed_avatar.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "runtime/src/pose/maps.h"
#include "runtime/src/pose/visibility.h"

namespace figurine {
namespace {

constexpr uint32_t kBlocksPerTask = 64;

constexpr uint32_t kHiddenBlock = ~uint32_t{0};  // of PoseScratch::left_out
static_assert(kernels::kLanes < 32);

uint32_t texels_of_block(const BodyBlocks& blocks, uint32_t block) {
  return std::min(kernels::kLanes, blocks.texels() - block * kernels::kLanes);
}

}  // namespace

bool PoseScratch::ensure(uint32_t joints, uint32_t blocks) {
  return transforms.ensure(joints, blocks) && own_from_rest.ensure(joints) &&
         left_out.ensure(blocks) && wanted.ensure(blocks) && pulled.ensure(size_t{4} * joints);
}

Result<std::unique_ptr<PosedAvatar>> PosedAvatar::create(const Avatar& avatar, const Body& body,
                                                         const BodyBlocks& blocks,
                                                         std::shared_ptr<const BodyGrid> grid,
                                                         Precision precision, ThreadPool& pool,
                                                         const KernelTable& kernels) {
  std::unique_ptr<PosedAvatar> posed(
      new (std::nothrow) PosedAvatar(avatar, body, blocks, precision, pool, kernels));
  if (posed == nullptr) return out_of_memory("an avatar");
  if (avatar.has_network()) {
    FIG_RETURN_IF_ERROR(posed->prepare_network(avatar, std::move(grid)));
  } else if (avatar.static_part.empty()) {
    return Status(StatusCode::kCorrupt, "avatar: neither a network nor a static part");
  }
  FIG_RETURN_IF_ERROR(posed->shape(avatar));
  FIG_RETURN_IF_ERROR(posed->learn_poses(avatar.pose_statistics));
  FIG_RETURN_IF_ERROR(posed->static_blocks_.ensure(avatar.static_part, body));
  FIG_RETURN_IF_ERROR(posed->extent_blocks_.ensure(avatar.smallest_extents, body));
  return posed;
}

Status PosedAvatar::prepare_network(const Avatar& avatar, std::shared_ptr<const BodyGrid> grid) {
  const uint32_t size = avatar.network.input_size;
  if (!grid_fits(body_.uv_size, size)) {
    return Status(StatusCode::kCorrupt,
                  "avatar: the network's grid has " + std::to_string(size) +
                      " cells a side, which is not 1, 1/2, 1/4 or 1/8 of the body's " +
                      std::to_string(body_.uv_size) + " texels");
  }
  grid_ = grid != nullptr ? std::move(grid) : BodyGrid::create(body_, size);
  if (grid_ == nullptr) return out_of_memory("a grid over a body's texels");
  if (!last_run_.rotations.ensure(size_t{4} * body_.joint_count()))
    return out_of_memory("an avatar's pose");
  Result<std::unique_ptr<AvatarNetwork>> network =
      AvatarNetwork::create(avatar, *grid_, precision_, pool_, kernels_);
  if (!network.ok()) return network.status();
  network_ = std::move(network).value();
  return {};
}

// Without a table of distances nothing is known: no distance means anything.
Status PosedAvatar::learn_poses(const PoseStatistics& statistics) {
  if (statistics.distances.empty()) return {};
  for (const uint8_t joint : statistics.joints) {
    if (joint >= body_.joint_count()) {
      return Status(StatusCode::kCorrupt,
                    "avatar: its pose statistics name joint " + std::to_string(joint));
    }
  }
  Result<KnownPoses> known = KnownPoses::create(statistics);
  if (!known.ok()) return known.status().within("avatar");
  known_poses_ = std::move(known).value();
  return {};
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

void PosedAvatar::select_blocks(const PoseJob& job, PoseScratch& scratch) const {
  const uint32_t count = blocks_.count();
  const GaussianBounds bounds = bounds_of(decoding_, extent_blocks_.largest_m());
  const float averted_above = job.approximation.averted_above;
  const bool may_hide = job.view != nullptr && job.leave_out.hidden_texels &&
                        bounds.offset_m < std::numeric_limits<float>::infinity(),
             may_avert = job.view != nullptr && averted_above < 1;
  if (may_hide || may_avert) {
    pool_.for_each((count + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
      const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask;
      for (uint32_t block = begin; block < std::min(begin + kBlocksPerTask, count); ++block) {
        const kernels::CanonicalBlock& texels = canonical_[block];
        const kernels::TransformBlock& transforms = scratch.transforms[block];
        const bool hidden = may_hide && !may_be_seen(texels, transforms, bounds, *job.view);
        scratch.left_out[block] =
            hidden      ? kHiddenBlock
            : may_avert ? find_averted(blocks_[block], texels, transforms, *job.view, averted_above)
                        : 0;
      }
    });
  } else {
    std::fill_n(scratch.left_out.data(), count, 0u);
  }
  scratch.wanted_count = 0;
  scratch.hidden_texels = scratch.averted_texels = 0;
  for (uint32_t block = 0; block < count; ++block) {
    const uint32_t texels = texels_of_block(blocks_, block), all = (1u << texels) - 1,
                   left_out = scratch.left_out[block];
    if (left_out == kHiddenBlock) {
      scratch.hidden_texels += texels;
      continue;
    }
    scratch.averted_texels += static_cast<uint64_t>(std::popcount(left_out & all));
    if ((left_out & all) != all) scratch.wanted[scratch.wanted_count++] = block;
  }
}

bool PosedAvatar::is_smaller(const PoseView& pose, const kernels::View& view, float side_px,
                             PoseScratch& scratch) const {
  const uint32_t joints = body_.joint_count();
  const float* const rest_m = joint_position_m_.data();
  skinning_transforms({body_.parents, joint_position_m_.span(size_t{3} * joints)}, pose,
                      scratch.own_from_rest.span(joints));
  BoxInImage box;
  for (uint32_t joint = 0; joint < joints; ++joint)
    widen(transform_point(scratch.own_from_rest[joint], rest_m + 3 * joint).data(), view, box);
  return box.side_px() < side_px;
}

bool PosedAvatar::is_small(const PoseJob& job, const Transforms& transforms) const {
  if (job.view == nullptr || !(job.approximation.network_below_px > 0)) return false;
  BoxInImage box;
  for (uint32_t block = 0; block < blocks_.count(); ++block)
    widen(canonical_[block], transforms[block], *job.view, box);
  return box.side_px() < job.approximation.network_below_px;
}

// To the bit: a zero of the other sign is another pose.
bool PosedAvatar::is_last_pose(const PoseView& pose) const {
  const auto same = [](const auto& a, const auto& b, size_t size_bytes) {
    return std::memcmp(a.data(), b.data(), size_bytes) == 0;
  };
  return same(pose.rotations, last_run_.rotations, pose.rotations.size_bytes()) &&
         same(pose.root_translation_m, last_run_.root_translation_m,
              sizeof(last_run_.root_translation_m));
}

// Whether the last run was one of a row for this avatar.
bool PosedAvatar::is_continued(const PoseJob& job) const {
  return line_.begun() && last_run_.done && job.avatar && job.avatar == last_run_.avatar;
}

std::optional<PoseRarity> PosedAvatar::rarity(const PoseView& pose) const {
  if (known_poses_.empty()) return std::nullopt;
  return known_poses_.rarity(pose.rotations);
}

// What the network is shown: the pose itself, or one in the scratch.
PoseView PosedAvatar::shown_pose(const PoseJob& job, PoseScratch& scratch) const {
  const std::span<float> pulled = scratch.pulled.span(job.pose.rotations.size());
  scratch.is_pulled = job.keep_to_known && network_ != nullptr && !known_poses_.empty() &&
                      known_poses_.pull(job.pose.rotations, pulled);
  return scratch.is_pulled ? PoseView{job.pose.root_translation_m, pulled} : job.pose;
}

NetworkUse PosedAvatar::choose_use(const PoseJob& job, const PoseView& shown,
                                   const PoseScratch& scratch) const {
  if (network_ == nullptr || scratch.wanted_count == 0) return NetworkUse::kNone;
  if (const uint32_t interval = job.approximation.network_interval; interval > 1) {
    const bool due =
        !is_continued(job) || last_run_.poses_left == 0 || last_run_.poses_since + 1 >= interval;
    return due ? NetworkUse::kRun : NetworkUse::kContinued;
  }
  // What is drawn with a line is not the last run's outputs.
  if (!last_run_.done || line_.begun()) return NetworkUse::kRun;
  if (job.leave_out.unchanged_networks && is_last_pose(shown)) return NetworkUse::kUnchanged;
  const bool stale =
      job.avatar && job.avatar == last_run_.avatar && is_small(job, scratch.transforms);
  return stale ? NetworkUse::kStale : NetworkUse::kRun;
}

// Runs the network on its input; with an interval, on all of it.
Status PosedAvatar::evaluate_network(const PoseJob& job, const PoseScratch& scratch) {
  const uint32_t interval = job.approximation.network_interval;
  if (interval == 1 || !job.avatar) {
    line_.forget();
    return network_->run(scratch.wanted_blocks());
  }
  const bool continued = is_continued(job);
  if (continued && !line_.begin_at(network_->outputs()))
    return out_of_memory("a network's outputs");
  FIG_RETURN_IF_ERROR(network_->run_all());
  if (!continued && !line_.begin_at(network_->outputs()))
    return out_of_memory("a network's outputs");
  last_run_.poses_between = continued ? last_run_.poses_since + 1 : 1;
  last_run_.poses_since = 0;
  // Avatars that begin together take turns from then on.
  last_run_.poses_left =
      interval - 1 - (continued ? 0 : static_cast<uint32_t>(*job.avatar) % interval);
  return {};
}

// Maps of another pose take its transforms, which then make room for the true ones again: it costs
// a rare frame more time, and no frame memory.
void PosedAvatar::draw_maps_of(const PoseJob& job, const PoseView& shown, PoseScratch& scratch) {
  const auto transform = [&](const PoseView& pose) {
    scratch.transforms.pose(body_, blocks_, joint_position_m_.span(size_t{3} * body_.joint_count()),
                            pose, pool_, kernels_);
  };
  if (scratch.is_pulled) transform(shown);
  draw_maps(*grid_, blocks_, scratch.transforms, root_position(body_.mean_skeleton(), shown),
            statistics_, network_->input(), pool_, kernels_);
  if (scratch.is_pulled) transform(job.pose);
}

Status PosedAvatar::run_network(const PoseJob& job, const PoseView& shown, PoseScratch& scratch,
                                StageClock& clock) {
  {
    const StageClock::Scope timed(clock, Stage::kMaps);
    draw_maps_of(job, shown, scratch);
  }
  const StageClock::Scope timed(clock, Stage::kNetwork);
  const Status evaluated = evaluate_network(job, scratch);
  last_run_.done = evaluated.ok();
  FIG_RETURN_IF_ERROR(evaluated);
  std::copy(shown.rotations.begin(), shown.rotations.end(), last_run_.rotations.data());
  last_run_.root_translation_m = shown.root_translation_m;
  last_run_.avatar = job.avatar;
  return {};
}

Result<NetworkUse> PosedAvatar::pose(const PoseJob& job, PoseScratch& scratch, StageClock& clock) {
  NetworkUse use = NetworkUse::kNone;
  PoseView shown;
  {
    const StageClock::Scope timed(clock, Stage::kSkin);
    scratch.transforms.pose(body_, blocks_, joint_position_m_.span(size_t{3} * body_.joint_count()),
                            job.pose, pool_, kernels_);
    select_blocks(job, scratch);
    shown = shown_pose(job, scratch);
    use = choose_use(job, shown, scratch);
  }
  if (use == NetworkUse::kRun) {
    FIG_RETURN_IF_ERROR(run_network(job, shown, scratch, clock));
  } else if (use != NetworkUse::kNone) {
    const StageClock::Scope timed(clock, Stage::kNetwork);
    if (use == NetworkUse::kContinued) {
      ++last_run_.poses_since, --last_run_.poses_left;
    } else {
      network_->run_further(scratch.wanted_blocks());
    }
  }
  if (line_.begun() && use != NetworkUse::kNone) {
    const StageClock::Scope timed(clock, Stage::kNetwork);
    line_.go_on(network_->outputs(), static_cast<float>(last_run_.poses_since) /
                                         static_cast<float>(last_run_.poses_between));
  }
  return use;
}

// Where the heads of a block's texels are: of each, or of the cells that it lies between. Without a
// network they are zeros.
void PosedAvatar::find_heads(uint32_t block, kernels::DecodeSkinJob& job) const {
  static constexpr float kNoHead[kernels::kShapeValues + kernels::kMaxShValues] = {};
  if (network_ == nullptr) {
    std::fill_n(job.head[0], kernels::kLanes, kNoHead);
    return;
  }
  const float* const outputs = line_.begun() ? line_.outputs() : network_->outputs().data();
  job.taps = grid_->taps(block);
  if (job.taps != nullptr) {
    for (uint32_t k = 0; k < kernels::kTaps; ++k)
      network_->find_heads(outputs, job.taps->row[k], job.head[k]);
    return;
  }
  uint32_t rows[kernels::kLanes];
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
    rows[lane] = texel_of_lane(block, lane, blocks_.texels());
  network_->find_heads(outputs, rows, job.head[0]);
}

uint32_t PosedAvatar::decode(const PoseScratch& scratch, uint32_t block, uint32_t sh_degree,
                             kernels::GaussianBlock& out) const {
  kernels::DecodeSkinJob job{.head = {},
                             .taps = nullptr,
                             .static_part = static_blocks_.of(block),
                             .smallest = extent_blocks_.of(block),
                             .texels = &canonical_[block],
                             .transforms = &scratch.transforms[block],
                             .offset_scale_m = decoding_.offset_scale_m,
                             .max_offset = decoding_.max_offset == 0
                                               ? std::numeric_limits<float>::infinity()
                                               : decoding_.max_offset,
                             .max_log_scale = decoding_.max_log_scale,
                             .opacity_bias = decoding_.opacity_bias,
                             .sh_values = 3 * sh_coefficients(sh_degree),
                             .gaussians = &out};
  find_heads(block, job);
  kernels_.decode_skin(job);
  for (uint32_t left = scratch.left_out[block]; left != 0; left &= left - 1)
    out.opacity[std::countr_zero(left)] = 0;
  return texels_of_block(blocks_, block);
}

uint64_t PosedAvatar::memory_bytes() const {
  return (network_ == nullptr ? 0 : network_->memory_bytes()) + last_run_.rotations.memory_bytes() +
         line_.memory_bytes() + known_poses_.memory_bytes() + joint_position_m_.memory_bytes() +
         canonical_.memory_bytes() + static_blocks_.memory_bytes() + extent_blocks_.memory_bytes();
}

}  // namespace figurine
