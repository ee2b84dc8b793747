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

}  // namespace

void draw_maps(const Body& body, const BodyBlocks& blocks, const Transforms& transforms,
               const std::array<float, 3>& root_m, const MapStatistics& statistics,
               const MapTarget& target, ThreadPool& pool, const KernelTable& kernels) {
  const auto values_of = [&](uint32_t texel) {
    return target.values + size_t{texel} * target.stride;
  };
  const uint32_t count = blocks.count();
  const kernels::PoseMapsJob of_all = make_job(root_m, statistics);
  pool.for_each((count + kBlocksPerTask - 1) / kBlocksPerTask, [&](size_t task) {
    const uint32_t begin = static_cast<uint32_t>(task) * kBlocksPerTask;
    float maps[kernels::kMapPlanes][kernels::kLanes];
    kernels::PoseMapsJob job = of_all;
    job.maps = maps;
    for (uint32_t block = begin; block < std::min(begin + kBlocksPerTask, count); ++block) {
      job.texels = &blocks[block];
      job.transforms = &transforms[block];
      kernels.pose_maps(job);
      for (uint32_t lane = 0; lane < kernels::kLanes; ++lane) {
        float* const out = values_of(body.texel[texel_of_lane(block, lane, blocks.texels())]);
        for (uint32_t c = 0; c < kernels::kMapPlanes; ++c) out[c] = maps[c][lane];
      }
    }
  });
  const size_t borders = body.border_texel.size();
  pool.for_each((borders + kBordersPerTask - 1) / kBordersPerTask, [&](size_t task) {
    const size_t begin = task * kBordersPerTask;
    for (size_t i = begin; i < std::min(begin + kBordersPerTask, borders); ++i) {
      std::copy_n(values_of(body.texel[body.border_source[i]]), kMapChannels,
                  values_of(body.border_texel[i]));
    }
  });
}

}  // namespace figurine
