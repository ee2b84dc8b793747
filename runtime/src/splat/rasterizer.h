// Any number of Gaussian sets into one image: project, sort by depth, bin into tiles, blend,
// resolve.
//
// A frame never allocates after begin(), and never fails after it.
//
// Based on: Kerbl et al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023
// (tiles, front-to-back blending); here one global depth sort and a stable counting bin take the
// place of sorting (tile, depth) pairs, and ellipses are bounded exactly.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>

#include "figurine/camera.h"
#include "figurine/frame.h"
#include "figurine/gaussian.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/splat/depth_sort.h"
#include "runtime/src/splat/gaussian_blocks.h"
#include "runtime/src/splat/tile_bins.h"

namespace figurine {

class Rasterizer {
 public:
  Rasterizer(ThreadPool& pool, const KernelTable& kernels)
      : pool_(pool), kernels_(kernels), depth_sort_(pool), bins_(pool) {}

  // Starts a frame of at most so many blocks of Gaussians. The view is make_view's. Error:
  // kOutOfMemory.
  Status begin(const kernels::View& view, const LeaveOut& leave_out,
               const Approximation& approximation, uint32_t blocks);

  // Gaussians that come in blocks.
  struct BlockSet {
    uint32_t blocks = 0, sh_degree = 0;
    bool antialiased = false;            // SplatOptions::antialiased
    Stage fill_stage = Stage::kProject;  // what the time of filling blocks counts for
  };
  // Projects a set of Gaussians behind those already added, block by block on all threads:
  // fill(i, block) fills block i and returns how many lanes hold a Gaussian. Sets count in the
  // order they are added where depths are equal.
  template <class Fill>
  void add(const BlockSet& set, StageClock& clock, const Fill& fill);
  void add(const GaussianView& gaussians, bool antialiased, StageClock& clock);

  // Sorts, bins, blends and writes every pixel of the target, which must be valid for the view.
  void draw(const ImageTarget& target, const std::optional<std::array<float, 3>>& background,
            StageClock& clock);

  // Fills what the frame's Gaussians came to; times and the rest stay as they are.
  void report(FrameStatistics& statistics) const;
  uint64_t memory_bytes() const;

 private:
  // Blocks of a task, and those of them that are filled before they are projected: few enough to
  // stay in the cache, many enough that two looks at the clock do not show.
  static constexpr uint32_t kBlocksPerTask = 16, kBlocksPerGroup = 4;

  struct TaskResult {
    uint32_t gaussians, visible, transparent, outside;
    uint64_t fill_ns, project_ns;
  };
  struct TileResult {
    uint64_t blends, stopped;
    uint64_t blend_ns, resolve_ns;
  };

  // A filled block and where its splats go.
  struct FilledBlock {
    const kernels::GaussianBlock& gaussians;
    uint32_t lanes, first_slot;
  };
  void project(const BlockSet& set, const FilledBlock& block, DepthSort::Item* items,
               TaskResult& result);
  void finish_add(const BlockSet& set, uint64_t elapsed_ns, StageClock& clock);
  void blend_tile(uint32_t tile, const ImageTarget& target,
                  const std::optional<std::array<float, 3>>& background, StageClock& clock);
  void finish_band(const TileBins::Band& band, uint64_t elapsed_ns, StageClock& clock);

  ThreadPool& pool_;
  const KernelTable& kernels_;
  kernels::View view_{};
  LeaveOut leave_out_;
  Approximation approximation_;

  // One slot per lane of every block added, filled for the visible ones.
  uint32_t slots_ = 0, visible_ = 0;
  uint64_t gaussians_ = 0, transparent_ = 0, outside_ = 0;
  Buffer<kernels::Splat> splats_;
  Buffer<TaskResult> task_result_;  // of the set being added
  DepthSort depth_sort_;

  TileBins bins_;
  uint64_t blends_ = 0, stopped_ = 0;
  Buffer<TileResult> tile_result_;
};

template <class Fill>
void Rasterizer::add(const BlockSet& set, StageClock& clock, const Fill& fill) {
  const uint64_t begin_ns = clock.now();
  const uint32_t first_slot = slots_;
  pool_.for_each((set.blocks + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
    const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask,
                   end = std::min(begin + kBlocksPerTask, set.blocks);
    DepthSort::Item* const items = depth_sort_.items() + first_slot + begin * kernels::kLanes;
    TaskResult result{};
    kernels::GaussianBlock group[kBlocksPerGroup];
    uint32_t lanes[kBlocksPerGroup];
    for (uint32_t first = begin; first < end; first += kBlocksPerGroup) {
      const uint32_t count = std::min(kBlocksPerGroup, end - first);
      const uint64_t started_ns = clock.now();
      for (uint32_t i = 0; i < count; ++i) lanes[i] = fill(first + i, group[i]);
      const uint64_t filled_ns = clock.now();
      for (uint32_t i = 0; i < count; ++i) {
        project(set, {group[i], lanes[i], first_slot + (first + i) * kernels::kLanes}, items,
                result);
      }
      result.fill_ns += filled_ns - started_ns;
      result.project_ns += clock.now() - filled_ns;
    }
    task_result_[task] = result;
  });
  finish_add(set, clock.now() - begin_ns, clock);
}

}  // namespace figurine
