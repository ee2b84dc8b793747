#include "runtime/src/pose/maps.h"

#include <algorithm>

namespace figurine {
namespace {

constexpr uint32_t kBlocksPerTask = 32;
constexpr size_t kBordersPerTask = 1024;

// The same job for every block but for its texels and transforms.
kernels::PoseMapsJob make_job(const std::array<float, 3>& root_m, const MapStatistics& statistics) {
  kernels::PoseMapsJob job{};
  std::copy(root_m.begin(), root_m.end(), job.root_m);
  std::copy(statistics.mean.begin(), statistics.mean.end(), job.mean);
  std::copy(statistics.scale.begin(), statistics.scale.end(), job.scale);
  return job;
}

// What the maps of 16 texels from anywhere in the body are drawn from: of the texels' own block, a
// lane each.
struct GatheredTexels {
  kernels::TexelBlock texels;  // places and normals alone
  kernels::TransformBlock transforms;
};

void gather(const BodyBlocks& blocks, const Transforms& transforms,
            std::span<const uint32_t> source, uint32_t block, GatheredTexels& out) {
  for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
    const uint32_t texel = source[texel_of_lane(block, lane, static_cast<uint32_t>(source.size()))];
    const uint32_t from = texel % kernels::kLanes;
    const kernels::TexelBlock& texels = blocks[texel / kernels::kLanes];
    const kernels::TransformBlock& moved = transforms[texel / kernels::kLanes];
    for (uint32_t k = 0; k < 3; ++k) {
      out.texels.mean_position_m[k][lane] = texels.mean_position_m[k][from];
      out.texels.mean_normal[k][lane] = texels.mean_normal[k][from];
      out.transforms.mean_translation_m[k][lane] = moved.mean_translation_m[k][from];
    }
    for (uint32_t k = 0; k < 9; ++k) out.transforms.linear[k][lane] = moved.linear[k][from];
  }
}

void draw_cells(const BodyGrid& grid, const BodyBlocks& blocks, const Transforms& transforms,
                const MapTarget& target, kernels::PoseMapsJob job, uint32_t begin, uint32_t end,
                const KernelTable& kernels) {
  float maps[kernels::kMapPlanes][kernels::kLanes];
  GatheredTexels gathered;
  job.maps = maps;
  for (uint32_t block = begin; block < end; ++block) {
    if (grid.of_texels()) {
      job.texels = &blocks[block];
      job.transforms = &transforms[block];
    } else {
      gather(blocks, transforms, grid.source(), block, gathered);
      job.texels = &gathered.texels;
      job.transforms = &gathered.transforms;
    }
    kernels.pose_maps(job);
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
      const uint32_t cell = grid.cell()[texel_of_lane(block, lane, grid.cell_count())];
      float* const out = target.values + size_t{cell} * target.stride;
      for (uint32_t c = 0; c < kernels::kMapPlanes; ++c) out[c] = maps[c][lane];
    }
  }
}

}  // namespace

void draw_maps(const BodyGrid& grid, const BodyBlocks& blocks, const Transforms& transforms,
               const std::array<float, 3>& root_m, const MapStatistics& statistics,
               const MapTarget& target, ThreadPool& pool, const KernelTable& kernels) {
  const uint32_t count = grid.cell_blocks();
  const kernels::PoseMapsJob of_all = make_job(root_m, statistics);
  pool.for_each((count + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
    const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask;
    draw_cells(grid, blocks, transforms, target, of_all, begin,
               std::min(begin + kBlocksPerTask, count), kernels);
  });
  const auto values_of = [&](uint32_t cell) {
    return target.values + size_t{cell} * target.stride;
  };
  const size_t borders = grid.border_cell().size();
  pool.for_each((borders + kBordersPerTask - 1) / kBordersPerTask, [&](size_t task) {
    const size_t begin = task * kBordersPerTask;
    for (size_t i = begin; i < std::min(begin + kBordersPerTask, borders); ++i) {
      std::copy_n(values_of(grid.cell()[grid.border_source()[i]]), kMapChannels,
                  values_of(grid.border_cell()[i]));
    }
  });
}

}  // namespace figurine
