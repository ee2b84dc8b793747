// The device's renderer: avatars and poses in, pixels out. No files, no clock, no exceptions, no
// allocation per frame after the first.
//
//   auto renderer = Renderer::create({.threads = 2});
//   auto walker = (*renderer)->add_avatar(avatar_package, body_package);
//   FrameAvatar seen[] = {{.avatar = *walker, .pose = motion.pose(12)}};
//   (*renderer)->render({.camera = camera, .avatars = seen}, {.pixels = rgba, .stride_bytes = 4 *
//   width, .format = PixelFormat::kRgba8});
//
// A frame takes any number of avatars and static Gaussians, sorted together by view depth. Packages
// are borrowed: their bytes must outlive their avatars here (remove_avatar). A Renderer is used by
// one thread at a time; it spreads its own work over its pool. Its caller's way with floats
// (rounding, traps, denormals) changes nothing in it and is as before after every call; inside one,
// denormals are zero (docs/numerics.md, "Same pixels").
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "figurine/frame.h"
#include "figurine/isa.h"
#include "figurine/known_poses.h"
#include "figurine/package.h"
#include "figurine/status.h"
#include "figurine/threads.h"

namespace figurine {

struct RendererOptions {
  // 1 to 64, the caller's own counted. No more are started than the CPUs that the process may run
  // on, and fewer where the system gives no more: threads() says how many.
  uint32_t threads = 1;
  bool allow_oversubscription = false;  // more threads than CPUs: slower, for tests and experiments
  // Threads that others use as well (figurine/threads.h), in place of own ones: the two fields
  // above are not looked at then.
  std::shared_ptr<ThreadPool> pool;
  // The runtime has no clock of its own: with one, render() fills stage_ns. Nanoseconds from any
  // start; called by all threads of the pool, with now_user.
  uint64_t (*now_ns)(void* user) = nullptr;
  void* now_user = nullptr;
  // Which kernels run: the same pixels with every one. None: the largest set of supported_isas().
  std::optional<Isa> isa;
};

// The library that evaluates networks, and its version: "XNNPACK 0.20241108". Frames in fixed point
// are the same with every version that keeps its arithmetic; where a golden hash differs, this
// tells whether the library does too.
const char* network_library();

class Renderer {
 public:
  // kInvalidArgument for options out of range, kUnsupported for an instruction set that is not
  // there, kOutOfMemory.
  static Result<std::unique_ptr<Renderer>> create(const RendererOptions& options);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  // Packs the network's weights and allocates what a frame of it needs. precision: fixed point if
  // the avatar has it, otherwise float, unless said. kMismatch if the avatar was made for another
  // body; kUnsupported if it does not hold the precision. What was added before, by its content, is
  // held once: a crowd of one person costs one.
  Result<AvatarId> add_avatar(const Package& avatar, const Package& body,
                              std::optional<Precision> precision = std::nullopt);
  // The same of an avatar that is no package of its own: a population's member (open_member). Its
  // arrays are borrowed likewise; their meaning must have been verified, as open_member's is.
  Result<AvatarId> add_avatar(const Avatar& avatar, const Package& body,
                              std::optional<Precision> precision = std::nullopt);
  // Gives back what the avatar alone took; after that nothing of it, nor of its body unless another
  // avatar stands on that, is borrowed any more. Its id is refused from then on and never given to
  // another avatar. kInvalidArgument if there is no avatar of this id.
  Status remove_avatar(AvatarId avatar);
  uint32_t threads() const;                    // that frames are drawn with
  Precision precision(AvatarId avatar) const;  // of an avatar that was added

  // Draws one frame. kInvalidArgument on an unsound camera, pose, target or Gaussian count; nothing
  // was drawn then. Gaussians that are not finite are left out, one by one. The same input gives
  // the same pixels for any number of threads.
  Status render(const Frame& frame, const ImageTarget& target);

  // The world-space Gaussians of one avatar in one pose, as render() would splat them: its smallest
  // extents are in them, whether it is antialiased (Avatar) is for the caller to say. Valid until
  // the next call. For export and inspection.
  Result<GaussianView> pose_avatar(AvatarId avatar, const PoseView& pose);

  // How unusual a pose is to an avatar. None if its package has no table of distances
  // (PoseStatistics), or was opened without it. kInvalidArgument on an unsound pose, or if there is
  // no avatar of this id. Allocates nothing.
  Result<std::optional<PoseRarity>> pose_rarity(AvatarId avatar, const PoseView& pose) const;

  Isa isa() const;                            // of the kernels that run
  const FrameStatistics& statistics() const;  // of the last frame
  uint64_t memory_bytes() const;              // held now, XNNPACK's packed weights estimated

 private:
  struct Impl;
  explicit Renderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace figurine
