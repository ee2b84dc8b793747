// Any number of Gaussian sets into one image: project, sort by depth, bin into tiles, blend,
// resolve.
//
// Memory is bounded by the number of Gaussians and tiles alone. The (splat, tile) pairs are not: a
// frame whose pairs do not fit the list is drawn in bands of tiles, each of which does. So a frame
// never allocates after begin(), and never fails after it.
//
// Based on: Kerbl et al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023
// (tiles, front-to-back blending); here one global depth sort and a stable counting bin take the
// place of sorting (tile, depth) pairs, and ellipses are bounded exactly.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "figurine/camera.h"
#include "figurine/frame.h"
#include "figurine/gaussian.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/base/stage_clock.h"
#include "runtime/src/base/thread_pool.h"
#include "runtime/src/splat/depth_sort.h"
#include "runtime/src/splat/kernels/blend.h"
#include "runtime/src/splat/project.h"

namespace figurine {

class Rasterizer {
 public:
  explicit Rasterizer(ThreadPool& pool) : pool_(pool) {}

  // Starts a frame of at most gaussian_count Gaussians. The camera must be valid, alpha_cut in (0,
  // 0.5]. Error: kOutOfMemory.
  Status begin(const Camera& camera, float alpha_cut, uint32_t gaussian_count);

  // Projects a set behind those already added. Sets count in the order they are added where depths
  // are equal. The set is not needed afterwards.
  void add(const GaussianView& gaussians, StageClock& clock);

  // Sorts, bins, blends and writes every pixel of the target, which must be valid for the camera.
  void draw(const ImageTarget& target, const std::optional<std::array<float, 3>>& background,
            StageClock& clock);

  uint64_t gaussians() const { return added_; }
  uint64_t visible() const { return visible_; }
  uint64_t pairs() const { return pairs_; }
  uint64_t blends() const { return blends_; }
  uint64_t memory_bytes() const;

 private:
  struct TileRange {
    uint32_t begin, end;
  };

  uint32_t project_chunk(const GaussianView& gaussians, uint32_t begin, uint32_t end,
                         uint32_t first_slot);
  void count_pairs();
  void fill_pairs(const TileRange& band);
  void blend_tile(uint32_t tile, const ImageTarget& target,
                  const std::optional<std::array<float, 3>>& background, StageClock& clock);
  template <class Visit>
  void for_each_tile(uint32_t slot, const Visit& visit) const;

  ThreadPool& pool_;
  ViewParameters view_{};
  uint32_t tiles_x_ = 0, tiles_y_ = 0;

  // One slot per Gaussian added, filled for the visible ones.
  uint32_t added_ = 0, visible_ = 0;
  Buffer<kernels::Splat> splats_;
  Buffer<SplatBox> boxes_;
  Buffer<uint32_t> chunk_visible_;  // of the set being added: visible ones of each chunk
  DepthSort depth_sort_;
  const DepthSort::Item* sorted_ = nullptr;  // [visible_] front to back

  uint64_t pairs_ = 0, blends_ = 0;
  size_t pair_capacity_ = 0;
  Buffer<uint32_t> pair_splat_;  // slots, tile by tile, front to back
  Buffer<uint32_t> tile_count_;  // [tiles]
  Buffer<uint32_t> tile_begin_;  // [tiles] into pair_splat_, within a band
  Buffer<uint32_t> tile_cursor_;
  struct TileResult {
    uint64_t blends, blend_ns, resolve_ns;
  };
  Buffer<TileResult> tile_result_;
};

}  // namespace figurine
