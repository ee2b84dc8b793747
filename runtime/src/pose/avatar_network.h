// An avatar's network, whatever it computes in: maps in, heads of the wanted texels out.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/maps.h"

namespace figurine {

class AvatarNetwork {
 public:
  // Fourier channels are drawn here, once. The network's weights are read here and not afterwards;
  // the body's arrays are borrowed. Errors: kUnsupported if the avatar does not hold the precision;
  // kCorrupt if the network does not fit the maps or the head; those of the network's runner;
  // kOutOfMemory.
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const Body& body,
                                                       Precision precision, ThreadPool& pool,
                                                       const KernelTable& kernels);
  virtual ~AvatarNetwork() = default;

  // Where a pose's maps are drawn; zero wherever no texel of the body ever is.
  virtual MapTarget input() = 0;
  // Evaluates at least the texels of the wanted blocks, which are ascending.
  virtual Status run(std::span<const uint32_t> wanted_blocks) = 0;
  // The outputs for covered texel i of a wanted block, [head_channels].
  virtual const float* head(size_t i) const = 0;

  virtual Precision precision() const = 0;
  virtual uint64_t macs() const = 0;
  virtual uint64_t memory_bytes() const = 0;
};

}  // namespace figurine
