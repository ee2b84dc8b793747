#include "runtime/src/splat/rasterizer.h"

#include <algorithm>
#include <cstring>

#include "runtime/src/splat/resolve.h"

namespace figurine {

namespace {

// Two stages share a loop, so that what the first made is still in the cache for the second: the
// loop's time is divided as its tasks' times are.
void divide_time(uint64_t elapsed_ns, Stage first, uint64_t first_ns, Stage second,
                 uint64_t second_ns, StageClock& clock) {
  const uint64_t sum_ns = first_ns + second_ns;
  const double share = sum_ns == 0 ? 1 : double(first_ns) / double(sum_ns);
  const uint64_t part_ns = static_cast<uint64_t>(share * double(elapsed_ns));
  clock.add(first, part_ns);
  clock.add(second, elapsed_ns - part_ns);
}

}  // namespace

Status Rasterizer::begin(const kernels::View& view, const LeaveOut& leave_out,
                         const Approximation& approximation, uint32_t blocks) {
  view_ = view;
  leave_out_ = leave_out;
  approximation_ = approximation;
  slots_ = visible_ = 0;
  gaussians_ = transparent_ = outside_ = 0;
  blends_ = stopped_ = 0;
  const size_t slots = size_t{blocks} * kernels::kLanes;
  const bool fits = splats_.ensure(slots) && task_result_.ensure(blocks / kBlocksPerTask + 1) &&
                    depth_sort_.ensure(slots) &&
                    bins_.prepare(view.width_px, view.height_px, slots) &&
                    tile_result_.ensure(bins_.tiles());
  return fits ? Status() : out_of_memory("the frame's Gaussians and tiles");
}

// Projects a block into its slots; the visible ones' keys follow those that the task already has.
void Rasterizer::project(const BlockSet& set, const FilledBlock& block, DepthSort::Item* items,
                         TaskResult& result) {
  float depth_m[kernels::kLanes];
  const uint32_t leave_out = (leave_out_.transparent ? kernels::kLeaveOutTransparent : 0u) |
                             (leave_out_.outside ? kernels::kLeaveOutOutside : 0u);
  const kernels::ProjectedLanes projected =
      kernels_.project_block({.view = &view_,
                              .gaussians = &block.gaussians,
                              .count = block.lanes,
                              .sh_degree = set.sh_degree,
                              .leave_out = leave_out,
                              .antialiased = set.antialiased ? 1u : 0u,
                              .splats = splats_.data() + block.first_slot,
                              .depth_m = depth_m});
  result.gaussians += block.lanes;
  result.transparent += static_cast<uint32_t>(std::popcount(projected.transparent));
  result.outside += static_cast<uint32_t>(std::popcount(projected.outside));
  for (uint32_t left = projected.visible; left != 0; left &= left - 1) {
    const uint32_t lane = static_cast<uint32_t>(std::countr_zero(left));
    items[result.visible++] = {.depth_bits = std::bit_cast<uint32_t>(depth_m[lane]),
                               .index = block.first_slot + lane};
  }
}

void Rasterizer::finish_add(const BlockSet& set, uint64_t elapsed_ns, StageClock& clock) {
  // Tasks left gaps; closing them in order keeps the input order, which breaks ties of depth.
  DepthSort::Item* const items = depth_sort_.items();
  uint64_t fill_ns = 0, project_ns = 0;
  for (uint32_t task = 0; task < (set.blocks + kBlocksPerTask - 1) / kBlocksPerTask; ++task) {
    const TaskResult& result = task_result_[task];
    std::memmove(items + visible_, items + slots_ + task * kBlocksPerTask * kernels::kLanes,
                 result.visible * sizeof(DepthSort::Item));
    visible_ += result.visible;
    gaussians_ += result.gaussians;
    transparent_ += result.transparent;
    outside_ += result.outside;
    fill_ns += result.fill_ns;
    project_ns += result.project_ns;
  }
  slots_ += set.blocks * kernels::kLanes;
  divide_time(elapsed_ns, set.fill_stage, fill_ns, Stage::kProject, project_ns, clock);
}

void Rasterizer::add(const GaussianView& gaussians, bool antialiased, StageClock& clock) {
  add({.blocks = block_count(gaussians.count),
       .sh_degree = std::min(gaussians.sh_degree, approximation_.sh_degree),
       .antialiased = antialiased},
      clock, [&](uint32_t block, kernels::GaussianBlock& out) {
        return load_block(gaussians, block, out);
      });
}

void Rasterizer::blend_tile(uint32_t index, const ImageTarget& target,
                            const std::optional<std::array<float, 3>>& background,
                            StageClock& clock) {
  constexpr int32_t kTile = kernels::kTileSize;
  const int32_t x = static_cast<int32_t>(index % bins_.tiles_x()) * kTile,
                y = static_cast<int32_t>(index / bins_.tiles_x()) * kTile;
  const TileArea area{.x = x,
                      .y = y,
                      .width = std::min(kTile, static_cast<int32_t>(view_.width_px) - x),
                      .height = std::min(kTile, static_cast<int32_t>(view_.height_px) - y)};
  const uint32_t count = bins_.count_of(index);
  kernels::TilePixels pixels;
  kernels::BlendedTile blended{};
  const uint64_t begin_ns = clock.now();
  if (count != 0) {
    const kernels::BlendTileJob job{.splats = splats_.data(),
                                    .order = bins_.order(index),
                                    .count = count,
                                    .x = area.x,
                                    .y = area.y,
                                    .width = area.width,
                                    .height = area.height,
                                    .alpha_cut = view_.alpha_cut,
                                    .leave_out_stopped = leave_out_.stopped ? 1u : 0u,
                                    .pixels = &pixels};
    blended =
        approximation_.fast_blend ? kernels_.blend_tile_fast(job, {}) : kernels_.blend_tile(job);
  }
  const uint64_t blended_ns = clock.now();
  resolve_tile(kernels_, area, count == 0 ? nullptr : &pixels, background, target);
  tile_result_[index] = {.blends = blended.contributions,
                         .stopped = count - blended.splats,
                         .blend_ns = blended_ns - begin_ns,
                         .resolve_ns = clock.now() - blended_ns};
}

void Rasterizer::finish_band(const TileBins::Band& band, uint64_t elapsed_ns, StageClock& clock) {
  uint64_t blend_ns = 0, resolve_ns = 0;
  for (uint32_t tile = band.begin; tile < band.end; ++tile) {
    blends_ += tile_result_[tile].blends;
    stopped_ += tile_result_[tile].stopped;
    blend_ns += tile_result_[tile].blend_ns;
    resolve_ns += tile_result_[tile].resolve_ns;
  }
  divide_time(elapsed_ns, Stage::kBlend, blend_ns, Stage::kResolve, resolve_ns, clock);
}

void Rasterizer::draw(const ImageTarget& target,
                      const std::optional<std::array<float, 3>>& background, StageClock& clock) {
  const DepthSort::Item* sorted = nullptr;
  {
    const StageClock::Scope timed(clock, Stage::kSort);
    sorted = depth_sort_.sort(visible_);
  }
  {
    const StageClock::Scope timed(clock, Stage::kBin);
    bins_.count(splats_.data(), sorted, visible_, leave_out_.missed_tiles);
  }
  const uint32_t tiles = bins_.tiles();
  for (TileBins::Band band{0, 0}; band.end < tiles;) {
    {
      const StageClock::Scope timed(clock, Stage::kBin);
      band = bins_.fill_band(band.end);
    }
    const uint64_t begin_ns = clock.now();
    pool_.for_each(band.end - band.begin, [&](size_t i) {
      blend_tile(band.begin + static_cast<uint32_t>(i), target, background, clock);
    });
    finish_band(band, clock.now() - begin_ns, clock);
  }
}

void Rasterizer::report(FrameStatistics& statistics) const {
  statistics.gaussians = gaussians_;
  statistics.visible = visible_;
  statistics.pairs = bins_.pair_count();
  statistics.blends = blends_;
  statistics.left_out.transparent = transparent_;
  statistics.left_out.outside = outside_;
  statistics.left_out.missed_tiles = bins_.missed_pairs();
  statistics.left_out.stopped = stopped_;
}

uint64_t Rasterizer::memory_bytes() const {
  return splats_.memory_bytes() + task_result_.memory_bytes() + depth_sort_.memory_bytes() +
         bins_.memory_bytes() + tile_result_.memory_bytes();
}

}  // namespace figurine
