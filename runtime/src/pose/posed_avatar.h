// One avatar, ready to be posed: its network, its person's canonical texels and joints, and the
// plan of a frame from a pose to world-space Gaussians.
//
//   pose -> transforms -> which texels are wanted -> maps of the mean template, of this pose or of
//        one that the network knows better -> network
//        -> wanted blocks: heads between a coarser network's, static part, decoding and linear
//        blend
//           skinning -> Gaussians
//
// Maps and network are left out where the network has said all of it before, and do not exist where
// the avatar is its static part alone.
// Based on: Loper et al., SMPL, 2015 (skinning); the head's parametrisation of figurine/avatar.h.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/frame.h"
#include "figurine/known_poses.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/avatar_network.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/body_grid.h"
#include "runtime/src/pose/extent_blocks.h"
#include "runtime/src/pose/output_line.h"
#include "runtime/src/pose/static_blocks.h"
#include "runtime/src/pose/transforms.h"

namespace figurine {

// What a pose is worked out in, shared by all avatars of a renderer: one is posed and projected
// before the next.
struct PoseScratch {
  Transforms transforms;
  Buffer<Affine> own_from_rest;  // [J] of a figure whose size is asked for
  Buffer<uint32_t> left_out;     // [blocks] a bit a lane
  Buffer<uint32_t> wanted;       // [blocks] the wanted ones, ascending
  Buffer<float> pulled;          // [J,4] what the network is shown, if not the pose itself
  bool is_pulled = false;
  uint32_t wanted_count = 0;
  uint64_t hidden_texels = 0, averted_texels = 0;

  bool ensure(uint32_t joints, uint32_t blocks);
  std::span<const uint32_t> wanted_blocks() const { return wanted.span(wanted_count); }
  uint64_t memory_bytes() const {
    return transforms.memory_bytes() + own_from_rest.memory_bytes() + left_out.memory_bytes() +
           wanted.memory_bytes() + pulled.memory_bytes();
  }
};

// A pose and what is wanted of it.
struct PoseJob {
  PoseView pose;  // must be valid for the body
  // Whose it is, equal avatars sharing a PosedAvatar. None: that of no frame, which no later pose
  // keeps anything of that is not exact.
  std::optional<AvatarId> avatar;
  bool keep_to_known = false;           // FrameAvatar's
  const kernels::View* view = nullptr;  // null: all texels are wanted
  LeaveOut leave_out;
  Approximation approximation;
};

// How the outputs of the network for a pose came about.
enum class NetworkUse : uint8_t {
  kNone,       // nothing is wanted, or there is no network
  kRun,        // the network ran
  kUnchanged,  // its last run was for this pose
  kStale,      // its last run was for another pose of the avatar, which is small in the image
  kContinued   // its last run was for another pose of the avatar, and the next is not due
};

class PosedAvatar {
 public:
  // The arrays behind avatar and body are borrowed and must outlive the object, as must blocks,
  // which are the body's. Static part and smallest extents must fit the body
  // (validate_static_part, validate_smallest_extents). grid: the network's over the body if another
  // avatar has it, otherwise null. Errors:
  // AvatarNetwork::create's; kCorrupt if shape or grid do not fit the body; kOutOfMemory.
  static Result<std::unique_ptr<PosedAvatar>> create(const Avatar& avatar, const Body& body,
                                                     const BodyBlocks& blocks,
                                                     std::shared_ptr<const BodyGrid> grid,
                                                     Precision precision, ThreadPool& pool,
                                                     const KernelTable& kernels);

  const Body& body() const { return body_; }
  uint32_t block_count() const { return blocks_.count(); }
  uint32_t sh_degree() const { return decoding_.sh_degree; }
  bool antialiased() const { return antialiased_; }
  Precision precision() const { return precision_; }
  uint64_t macs() const { return network_ == nullptr ? 0 : network_->macs(); }
  // None without a table of distances. The pose must be valid.
  std::optional<PoseRarity> rarity(const PoseView& pose) const;
  // The network's; null without one.
  const std::shared_ptr<const BodyGrid>& grid() const { return grid_; }

  // Whether a figure in this pose is smaller in the image, by the box of its joints.
  bool is_smaller(const PoseView& pose, const kernels::View& view, float side_px,
                  PoseScratch& scratch) const;

  // Transforms, maps and network of a pose. The scratch must have room and then says which blocks
  // are wanted.
  Result<NetworkUse> pose(const PoseJob& job, PoseScratch& scratch, StageClock& clock);

  // The Gaussians of a wanted block of the last pose, with spherical harmonics to a degree that is
  // at most the avatar's; returns how many lanes hold one. Callable by several threads at a time.
  uint32_t decode(const PoseScratch& scratch, uint32_t block, uint32_t sh_degree,
                  kernels::GaussianBlock& out) const;

  uint64_t memory_bytes() const;  // without the grid, which others may share

 private:
  PosedAvatar(const Avatar& avatar, const Body& body, const BodyBlocks& blocks, Precision precision,
              ThreadPool& pool, const KernelTable& kernels)
      : body_(body),
        blocks_(blocks),
        pool_(pool),
        kernels_(kernels),
        precision_(precision),
        statistics_(avatar.map_statistics),
        decoding_(avatar.decoding),
        antialiased_(avatar.antialiased) {}

  Status shape(const Avatar& avatar);
  Status learn_poses(const PoseStatistics& statistics);
  Status prepare_network(const Avatar& avatar, std::shared_ptr<const BodyGrid> grid);
  void select_blocks(const PoseJob& job, PoseScratch& scratch) const;
  PoseView shown_pose(const PoseJob& job, PoseScratch& scratch) const;
  NetworkUse choose_use(const PoseJob& job, const PoseView& shown,
                        const PoseScratch& scratch) const;
  bool is_continued(const PoseJob& job) const;
  bool is_last_pose(const PoseView& pose) const;
  bool is_small(const PoseJob& job, const Transforms& transforms) const;
  void draw_maps_of(const PoseJob& job, const PoseView& shown, PoseScratch& scratch);
  Status run_network(const PoseJob& job, const PoseView& shown, PoseScratch& scratch,
                     StageClock& clock);
  Status evaluate_network(const PoseJob& job, const PoseScratch& scratch);
  void find_heads(uint32_t block, kernels::DecodeSkinJob& job) const;

  // Which pose the network's last run was for, as it was shown.
  struct LastRun {
    bool done = false;
    std::optional<AvatarId> avatar;
    // For OutputLine: poses that its outputs served beside; to it from the run before; and those
    // that they may serve further.
    uint32_t poses_since = 0, poses_between = 1, poses_left = 0;
    std::array<float, 3> root_translation_m{};
    Buffer<float> rotations;  // [J,4]
  };

  const Body body_;
  const BodyBlocks& blocks_;
  ThreadPool& pool_;
  const KernelTable& kernels_;
  const Precision precision_;
  const MapStatistics statistics_;
  const HeadDecoding decoding_;
  const bool antialiased_;
  std::shared_ptr<const BodyGrid> grid_;    // in front of what borrows from it
  std::unique_ptr<AvatarNetwork> network_;  // null: the static part is all there is
  KnownPoses known_poses_;
  LastRun last_run_;
  OutputLine line_;
  Buffer<float> joint_position_m_;             // [J,3] of the template the Gaussians sit on
  Buffer<kernels::CanonicalBlock> canonical_;  // [blocks]
  StaticBlocks static_blocks_;
  ExtentBlocks extent_blocks_;
};

}  // namespace figurine
