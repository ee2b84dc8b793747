// An avatar's network, whatever it computes in: maps in, heads of the wanted cells out.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "figurine/avatar.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/pose/body_grid.h"
#include "runtime/src/pose/maps.h"

namespace figurine {

class AvatarNetwork {
 public:
  // Fourier channels are drawn here, once. The network's weights are read here and not afterwards;
  // the grid, of the network's size, is borrowed. Errors: kUnsupported if the avatar does not hold
  // the precision; kCorrupt if the network does not fit the maps or the head; those of the
  // network's runner; kOutOfMemory.
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const BodyGrid& grid,
                                                       Precision precision, ThreadPool& pool,
                                                       const KernelTable& kernels);
  virtual ~AvatarNetwork() = default;

  // Where a pose's maps are drawn; zero wherever no cell of the grid ever is.
  virtual MapTarget input() = 0;
  // Evaluates at least the cells that the wanted blocks of texels lie between.
  virtual Status run(std::span<const uint32_t> wanted_blocks) = 0;
  // What run() of further blocks would have evaluated beside: the maps are still those of the last
  // run.
  virtual void run_further(std::span<const uint32_t> wanted_blocks) = 0;
  // run() for every cell.
  virtual Status run_all() = 0;

  // All outputs: of cells that have been evaluated those of the last run.
  virtual std::span<const float> outputs() const = 0;
  // Where the outputs of covered cells are, [head_channels] each, in outputs() or a copy of them.
  virtual void find_heads(const float* outputs, const uint32_t (&rows)[kernels::kLanes],
                          const float* (&heads)[kernels::kLanes]) const = 0;

  virtual uint64_t macs() const = 0;
  virtual uint64_t memory_bytes() const = 0;
};

}  // namespace figurine
