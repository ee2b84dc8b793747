// One avatar, ready to be posed: its network, its person's canonical texels and joints, and the
// plan of a frame from a pose to world-space Gaussians.
//
//   pose -> transforms -> which texels are wanted -> maps of the mean template -> network
//        -> wanted blocks: head decoding and linear blend skinning -> Gaussians
//
// Based on: Loper et al., SMPL, 2015 (skinning); the head's parametrisation of figurine/avatar.h.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/frame.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/avatar_network.h"
#include "runtime/src/pose/body_blocks.h"
#include "runtime/src/pose/transforms.h"

namespace figurine {

// What a pose is worked out in, shared by all avatars of a renderer: one is posed and projected
// before the next.
struct PoseScratch {
  Transforms transforms;
  Buffer<uint8_t> seen;     // [blocks]
  Buffer<uint32_t> wanted;  // [blocks] the wanted ones, ascending
  uint32_t wanted_count = 0;

  bool ensure(uint32_t joints, uint32_t blocks);
  std::span<const uint32_t> wanted_blocks() const { return wanted.span(wanted_count); }
  uint64_t memory_bytes() const {
    return transforms.memory_bytes() + seen.memory_bytes() + wanted.memory_bytes();
  }
};

class PosedAvatar {
 public:
  // The arrays behind avatar and body are borrowed and must outlive the object, as must blocks,
  // which are the body's. Errors: AvatarNetwork::create's; kCorrupt if the shape does not fit the
  // body; kOutOfMemory.
  static Result<std::unique_ptr<PosedAvatar>> create(const Avatar& avatar, const Body& body,
                                                     const BodyBlocks& blocks, Precision precision,
                                                     ThreadPool& pool, const KernelTable& kernels);

  const Body& body() const { return body_; }
  uint32_t block_count() const { return blocks_.count(); }
  uint32_t sh_degree() const { return decoding_.sh_degree; }
  Precision precision() const { return network_->precision(); }
  uint64_t macs() const { return network_->macs(); }

  // Transforms, maps and network of a pose, which must be valid for the body. The scratch must have
  // room and then says which blocks are wanted: all of them without a view.
  Status pose(const PoseView& pose, const kernels::View* view, const LeaveOut& leave_out,
              PoseScratch& scratch, StageClock& clock);

  // The Gaussians of a wanted block of the last pose; returns how many lanes hold one. Callable by
  // several threads at a time.
  uint32_t decode(const PoseScratch& scratch, uint32_t block, kernels::GaussianBlock& out) const;

  uint64_t memory_bytes() const;

 private:
  PosedAvatar(const Avatar& avatar, const Body& body, const BodyBlocks& blocks, ThreadPool& pool,
              const KernelTable& kernels)
      : body_(body),
        blocks_(blocks),
        pool_(pool),
        kernels_(kernels),
        statistics_(avatar.map_statistics),
        decoding_(avatar.decoding) {}

  Status shape(const Avatar& avatar);
  void select_blocks(const kernels::View* view, const LeaveOut& leave_out,
                     PoseScratch& scratch) const;

  const Body body_;
  const BodyBlocks& blocks_;
  ThreadPool& pool_;
  const KernelTable& kernels_;
  const MapStatistics statistics_;
  const HeadDecoding decoding_;
  std::unique_ptr<AvatarNetwork> network_;
  Buffer<float> joint_position_m_;             // [J,3] of the template the Gaussians sit on
  Buffer<kernels::CanonicalBlock> canonical_;  // [blocks]
};

}  // namespace figurine
