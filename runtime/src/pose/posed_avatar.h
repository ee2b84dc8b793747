// One avatar, ready to be posed: its network, its person's canonical texels and joints, and the way
// from a pose to world-space Gaussians.
//
//   pose -> posed maps of the mean template -> network -> head decoding (canonical Gaussians) ->
//   linear blend skinning -> Gaussians
//
// Based on: Loper et al., SMPL, 2015 (skinning); the head's parametrisation of figurine/avatar.h.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/gaussian.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/nn/fixed_point_runner.h"
#include "runtime/src/nn/network_runner.h"

namespace figurine {

// World-space Gaussians, shared by all avatars of a renderer: one is posed and projected before the
// next.
struct GaussianArrays {
  Buffer<float> position_m, covariance_factor, opacity, sh;

  bool ensure(size_t count, uint32_t sh_degree);
  GaussianView view(uint32_t count, uint32_t sh_degree) const;
  uint64_t memory_bytes() const {
    return position_m.memory_bytes() + covariance_factor.memory_bytes() + opacity.memory_bytes() +
           sh.memory_bytes();
  }
};

class PosedAvatar {
 public:
  // The arrays behind avatar and body are borrowed and must outlive the object. Errors:
  // kUnsupported if the avatar does not hold the precision; kCorrupt if the network does not fit
  // the maps or the decoding; those of the network's runner; kOutOfMemory.
  static Result<std::unique_ptr<PosedAvatar>> create(const Avatar& avatar, const Body& body,
                                                     Precision precision, ThreadPool& pool);

  const Body& body() const { return body_; }
  uint32_t sh_degree() const { return decoding_.sh_degree; }
  Precision precision() const {
    return fixed_point_ != nullptr ? Precision::kFixedPoint : Precision::kFloat32;
  }
  uint64_t macs() const { return fixed_point_ != nullptr ? fixed_point_->macs() : float_->macs(); }

  // Fills the arrays, which must have room, with one Gaussian per covered texel. The pose must be
  // valid for the body.
  Status pose(const PoseView& pose, GaussianArrays& gaussians, StageClock& clock);

  uint64_t memory_bytes() const;

 private:
  PosedAvatar(const Avatar& avatar, const Body& body, ThreadPool& pool)
      : body_(body), pool_(pool), statistics_(avatar.map_statistics), decoding_(avatar.decoding) {}

  Status create_float(const Avatar& avatar);
  Status create_fixed_point(const Avatar& avatar);
  void draw_maps(const PoseView& pose);
  Status run_network();
  // The network's outputs for covered texel i, [channels].
  const float* head(size_t i) const;
  void decode(uint32_t begin, uint32_t end, GaussianArrays& gaussians) const;
  void skin(uint32_t begin, uint32_t end, GaussianArrays& gaussians) const;

  const Body body_;
  ThreadPool& pool_;
  const MapStatistics statistics_;
  const HeadDecoding decoding_;
  // One of the two.
  std::unique_ptr<NetworkRunner> float_;
  std::unique_ptr<FixedPointRunner> fixed_point_;
  uint32_t input_channels_ = 0;
  Buffer<float> joint_position_m_;  // [J,3] of the template the Gaussians sit on
  Buffer<float> texel_position_m_;  // [N,3]
  Buffer<Affine> transforms_;       // [J] scratch
};

}  // namespace figurine
