#include "runtime/src/splat/rasterizer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "runtime/src/splat/resolve.h"

namespace figurine {
namespace {

constexpr uint32_t kChunk = 256;  // Gaussians that one task projects
constexpr int32_t kTile = kernels::kTileSize;
// A Gaussian of a person touches 1 to 4 tiles at usual sizes. The list holds at least one pair per
// Gaussian, so every single tile fits.
constexpr size_t kPairsPerGaussian = 4, kMinPairs = 65536;

}  // namespace

Status Rasterizer::begin(const Camera& camera, float alpha_cut, uint32_t gaussian_count) {
  view_ = make_view_parameters(camera, alpha_cut);
  tiles_x_ = (camera.width_px + kTile - 1) / kTile;
  tiles_y_ = (camera.height_px + kTile - 1) / kTile;
  added_ = visible_ = 0;
  pairs_ = blends_ = 0;
  sorted_ = nullptr;
  const size_t tiles = size_t(tiles_x_) * tiles_y_;
  pair_capacity_ = std::max(kMinPairs, kPairsPerGaussian * size_t(gaussian_count));
  const bool fits = splats_.ensure(gaussian_count) && boxes_.ensure(gaussian_count) &&
                    chunk_visible_.ensure(gaussian_count / kChunk + 1) &&
                    depth_sort_.ensure(gaussian_count) && pair_splat_.ensure(pair_capacity_) &&
                    tile_count_.ensure(tiles) && tile_begin_.ensure(tiles) &&
                    tile_cursor_.ensure(tiles) && tile_result_.ensure(tiles);
  return fits ? Status() : out_of_memory("the frame's Gaussians and tiles");
}

uint32_t Rasterizer::project_chunk(const GaussianView& gaussians, uint32_t begin, uint32_t end,
                                   uint32_t first_slot) {
  DepthSort::Item* out = depth_sort_.items() + first_slot + begin;
  uint32_t visible = 0;
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t slot = first_slot + i;
    float depth_m;
    if (!project_gaussian(view_, gaussians, i, splats_[slot], boxes_[slot], depth_m)) continue;
    out[visible++] = {.depth_bits = std::bit_cast<uint32_t>(depth_m), .index = slot};
  }
  return visible;
}

void Rasterizer::add(const GaussianView& gaussians, StageClock& clock) {
  const StageClock::Scope timed(clock, Stage::kProject);
  const uint32_t first_slot = added_, chunks = (gaussians.count + kChunk - 1) / kChunk;
  pool_.for_each(chunks, [&](size_t chunk) {
    const uint32_t begin = static_cast<uint32_t>(chunk) * kChunk,
                   end = std::min(begin + kChunk, gaussians.count);
    chunk_visible_[chunk] = project_chunk(gaussians, begin, end, first_slot);
  });
  // Chunks left gaps; closing them in order keeps the input order, which breaks ties of depth.
  DepthSort::Item* items = depth_sort_.items();
  for (uint32_t chunk = 0; chunk < chunks; ++chunk) {
    std::memmove(items + visible_, items + first_slot + chunk * kChunk,
                 chunk_visible_[chunk] * sizeof(DepthSort::Item));
    visible_ += chunk_visible_[chunk];
  }
  added_ += gaussians.count;
}

// visit(tile) for every tile that the splat's ellipse may touch. Exact per row of tiles: the
// ellipse is widest within the row at its widest point clamped to the row, because its extent is
// concave in y.
template <class Visit>
void Rasterizer::for_each_tile(uint32_t slot, const Visit& visit) const {
  const SplatBox box = boxes_[slot];
  if (box.tile_x_begin == box.tile_x_last) {
    for (uint32_t y = box.tile_y_begin; y <= box.tile_y_last; ++y)
      visit(y * tiles_x_ + box.tile_x_begin);
    return;
  }
  const kernels::Splat& splat = splats_[slot];
  constexpr float kSlackPx = 0.01f, kSlackRatio = 1.0001f;
  for (uint32_t y = box.tile_y_begin; y <= box.tile_y_last; ++y) {
    const float top = (static_cast<float>(y * kTile) + 0.5f) - splat.mean_y,
                bottom = top + static_cast<float>(kTile - 1);
    const auto half_width = [&](float dy) {
      const float v = dy * splat.scale_v, room = splat.reach - v * v;
      return room > 0 ? std::sqrt(room) * splat.inverse_scale_u * kSlackRatio + kSlackPx : kSlackPx;
    };
    const float dy_right = std::min(std::max(box.widest_dy_px, top), bottom),
                dy_left = std::min(std::max(-box.widest_dy_px, top), bottom);
    const float right = splat.mean_x + splat.slope * dy_right + half_width(dy_right);
    const float left = splat.mean_x + splat.slope * dy_left - half_width(dy_left);
    // Written so that anything not comparable falls back to the box.
    uint32_t first = box.tile_x_begin, last = box.tile_x_last;
    if (left >= static_cast<float>((first + 1) * kTile))
      first = left < static_cast<float>(last * kTile) ? static_cast<uint32_t>(left) / kTile : last;
    if (right < static_cast<float>(last * kTile))
      last =
          right > static_cast<float>(first * kTile) ? static_cast<uint32_t>(right) / kTile : first;
    for (uint32_t x = first; x <= last; ++x) visit(y * tiles_x_ + x);
  }
}

void Rasterizer::count_pairs() {
  std::memset(tile_count_.data(), 0, size_t(tiles_x_) * tiles_y_ * sizeof(uint32_t));
  for (uint32_t i = 0; i < visible_; ++i)
    for_each_tile(sorted_[i].index, [&](uint32_t tile) { ++tile_count_[tile]; });
  for (uint32_t tile = 0; tile < tiles_x_ * tiles_y_; ++tile) pairs_ += tile_count_[tile];
}

void Rasterizer::fill_pairs(const TileRange& band) {
  uint32_t sum = 0;
  for (uint32_t tile = band.begin; tile < band.end; ++tile) {
    tile_begin_[tile] = tile_cursor_[tile] = sum;
    sum += tile_count_[tile];
  }
  for (uint32_t i = 0; i < visible_; ++i) {
    const uint32_t slot = sorted_[i].index;
    for_each_tile(slot, [&](uint32_t tile) {
      if (tile >= band.begin && tile < band.end) pair_splat_[tile_cursor_[tile]++] = slot;
    });
  }
}

void Rasterizer::blend_tile(uint32_t index, const ImageTarget& target,
                            const std::optional<std::array<float, 3>>& background,
                            StageClock& clock) {
  kernels::TilePixels pixels;
  const int32_t x = static_cast<int32_t>(index % tiles_x_) * kTile,
                y = static_cast<int32_t>(index / tiles_x_) * kTile;
  const kernels::Tile tile{.splats = splats_.data(),
                           .order = pair_splat_.data() + tile_begin_[index],
                           .count = tile_count_[index],
                           .x = x,
                           .y = y,
                           .width = std::min(kTile, static_cast<int32_t>(view_.width_px) - x),
                           .height = std::min(kTile, static_cast<int32_t>(view_.height_px) - y),
                           .alpha_cut = view_.alpha_cut,
                           .pixels = &pixels};
  const uint64_t begin_ns = clock.now();
  const uint64_t blends = tile.count == 0 ? 0 : kernels::blend_tile_scalar(tile);
  const uint64_t blended_ns = clock.now();
  resolve_tile(tile, background, target);
  tile_result_[index] = {
      .blends = blends, .blend_ns = blended_ns - begin_ns, .resolve_ns = clock.now() - blended_ns};
}

void Rasterizer::draw(const ImageTarget& target,
                      const std::optional<std::array<float, 3>>& background, StageClock& clock) {
  {
    const StageClock::Scope timed(clock, Stage::kSort);
    sorted_ = depth_sort_.sort(visible_);
  }
  {
    const StageClock::Scope timed(clock, Stage::kBin);
    count_pairs();
  }
  const uint32_t tiles = tiles_x_ * tiles_y_;
  for (TileRange band{0, 0}; band.begin < tiles; band.begin = band.end) {
    size_t band_pairs = 0;
    for (band.end = band.begin;
         band.end < tiles && band_pairs + tile_count_[band.end] <= pair_capacity_; ++band.end)
      band_pairs += tile_count_[band.end];
    {
      const StageClock::Scope timed(clock, Stage::kBin);
      fill_pairs(band);
    }
    const uint64_t begin_ns = clock.now();
    pool_.for_each(
        band.end - band.begin,
        [&](size_t i) {
          blend_tile(band.begin + static_cast<uint32_t>(i), target, background, clock);
        },
        band.end == tiles ? ThreadPool::Afterwards::kSleep : ThreadPool::Afterwards::kSpin);
    // Blend and resolve share a loop, so that a tile is still in the cache: the loop's time is
    // divided as its tasks' times are.
    const uint64_t elapsed_ns = clock.now() - begin_ns;
    uint64_t blend_ns = 0, resolve_ns = 0;
    for (uint32_t tile = band.begin; tile < band.end; ++tile) {
      blends_ += tile_result_[tile].blends;
      blend_ns += tile_result_[tile].blend_ns;
      resolve_ns += tile_result_[tile].resolve_ns;
    }
    const double share =
        blend_ns + resolve_ns == 0 ? 1 : double(blend_ns) / double(blend_ns + resolve_ns);
    const uint64_t blend_part_ns = static_cast<uint64_t>(share * double(elapsed_ns));
    clock.add(Stage::kBlend, blend_part_ns);
    clock.add(Stage::kResolve, elapsed_ns - blend_part_ns);
  }
}

uint64_t Rasterizer::memory_bytes() const {
  return splats_.memory_bytes() + boxes_.memory_bytes() + chunk_visible_.memory_bytes() +
         depth_sort_.memory_bytes() + pair_splat_.memory_bytes() + tile_count_.memory_bytes() +
         tile_begin_.memory_bytes() + tile_cursor_.memory_bytes() + tile_result_.memory_bytes();
}

}  // namespace figurine
