#include "toolchain/model/splatter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "toolchain/model/parallel.h"
#include "toolchain/model/projection.h"
#include "toolchain/model/splat_kernels.h"

namespace figurine::model {

namespace {

constexpr uint32_t kChunk = 512;  // Gaussians per task
constexpr uint32_t kNotVisible = 0xffffffffu;

template <class Scalar>
const SplatKernels<Scalar>& kernels();
template <>
const SplatKernels<double>& kernels() {
  return generic::kDoubleKernels;
}
template <>
const SplatKernels<float>& kernels() {
#ifdef FIGURINE_X86_KERNELS
  static const SplatKernels<float>& chosen =
      __builtin_cpu_supports("x86-64-v4")   ? avx512::kFloatKernels
      : __builtin_cpu_supports("x86-64-v3") ? avx2::kFloatKernels
                                            : generic::kFloatKernels;
  return chosen;
#else
  return generic::kFloatKernels;
#endif
}

struct SortItem {
  uint32_t key, gaussian;
};

// Stable, ascending by key. Keys are bit patterns of positive floats, which order as integers.
void radix_sort(std::vector<SortItem>& items, std::vector<SortItem>& scratch) {
  constexpr int kBits = 11, kBuckets = 1 << kBits;
  scratch.resize(items.size());
  std::vector<uint32_t> first(3 * kBuckets, 0);
  for (const SortItem& item : items) {
    for (int pass = 0; pass < 3; ++pass)
      ++first[pass * kBuckets + ((item.key >> (pass * kBits)) & (kBuckets - 1))];
  }
  for (int pass = 0; pass < 3; ++pass) {
    uint32_t* const bucket = &first[pass * kBuckets];
    uint32_t sum = 0;
    for (int b = 0; b < kBuckets; ++b) {
      const uint32_t count = bucket[b];
      bucket[b] = sum;
      sum += count;
    }
    for (const SortItem& item : items)
      scratch[bucket[(item.key >> (pass * kBits)) & (kBuckets - 1)]++] = item;
    items.swap(scratch);
  }
}

// Tiles [x0,x1) x [y0,y1) that the box of alpha >= cut touches.
struct TileBox {
  uint16_t x0, x1, y0, y1;
};

}  // namespace

template <class Scalar>
struct Splatter<Scalar>::Impl {
  explicit Impl(const SplatterOptions& chosen) : options(chosen) {}

  void project_chunk(uint32_t begin, uint32_t end);
  void backward_chunk(uint32_t begin, uint32_t end, const GaussianGradients<Scalar>& gradients);
  void bin();
  TileJob<Scalar> tile_job(uint32_t tile);
  size_t tile_offset(uint32_t tile) const;

  SplatterOptions options;
  SplatterStatistics statistics;
  GaussianArrays<Scalar> gaussians;
  Camera camera;
  PixelRect crop;
  uint32_t tiles_x = 0, tiles_y = 0;
  std::vector<SplatRecord<Scalar>> records;  // [n]
  std::vector<TileBox> boxes;                // [n]
  std::vector<uint32_t> depth_keys;          // [n] kNotVisible: left out
  std::vector<SortItem> order, sort_scratch;
  std::vector<uint32_t> tile_first, tile_cursor;  // [tiles + 1]
  std::vector<SplatPair> pairs;                   // by tile, front to back
  std::vector<uint32_t> slots, slot_first,
      slot_count;  // pairs of Gaussian i: slots[slot_first[i] .. + slot_count[i])
  std::vector<uint64_t> tile_evaluations;
  std::vector<Scalar> pair_sums;  // [pairs, kPairSums]
};

template <class Scalar>
void Splatter<Scalar>::Impl::project_chunk(uint32_t begin, uint32_t end) {
  const ProjectionCamera<Scalar> view(camera, options.antialiased);
  const uint32_t sh_stride = 3 * sh_coefficients(gaussians.sh_degree);
  const Scalar cut = Scalar(options.alpha_cut), log2e = Scalar(1.4426950408889634074);
  const Scalar log2_cut = std::log2(cut);
  for (uint32_t i = begin; i < end; ++i) {
    depth_keys[i] = kNotVisible;
    Scalar opacity = gaussians.opacity[i];
    if (!(opacity >= cut) || !std::isfinite(opacity)) continue;
    Projected<Scalar> at;
    if (!project(view, gaussians.position_m + 3 * size_t(i),
                 gaussians.covariance_factor + 9 * size_t(i), at))
      continue;
    if (options.antialiased) opacity *= at.compensation();
    if (!(opacity >= cut)) continue;
    SplatRecord<Scalar>& record = records[i];
    record.mean_x = at.mean[0];
    record.mean_y = at.mean[1];
    record.p = Scalar(0.5) * log2e * at.c / at.determinant;
    record.k = at.b / at.c;
    record.q = Scalar(0.5) * log2e / at.c;
    record.log2_opacity = std::log2(opacity);
    // Box of alpha >= cut, widened by a hundredth of a pixel for rounding; the pixel's own test
    // decides.
    const Scalar reach = std::max(Scalar(2) * (record.log2_opacity - log2_cut) / log2e, Scalar(0));
    const Scalar rx = std::sqrt(reach * at.a) * Scalar(1.0001) + Scalar(0.01),
                 ry = std::sqrt(reach * at.c) * Scalar(1.0001) + Scalar(0.01);
    // First and last pixel whose centre is inside, relative to the crop.
    const Scalar left = at.mean[0] - rx - Scalar(0.5) - Scalar(crop.x),
                 right = at.mean[0] + rx - Scalar(0.5) - Scalar(crop.x);
    const Scalar top = at.mean[1] - ry - Scalar(0.5) - Scalar(crop.y),
                 bottom = at.mean[1] + ry - Scalar(0.5) - Scalar(crop.y);
    if (!(left <= Scalar(crop.width - 1)) || !(right >= 0) || !(top <= Scalar(crop.height - 1)) ||
        !(bottom >= 0))
      continue;
    const auto tile_of = [](Scalar pixel, uint32_t size) {
      return static_cast<uint16_t>(
          static_cast<uint32_t>(std::clamp(pixel, Scalar(0), Scalar(size - 1))) / kTileSize);
    };
    Scalar rgb[3];
    if (!sh_colour(view, gaussians.sh_degree, gaussians.position_m + 3 * size_t(i),
                   gaussians.sh + sh_stride * size_t(i), rgb))
      continue;
    record.red = rgb[0];
    record.green = rgb[1];
    record.blue = rgb[2];
    boxes[i] = {tile_of(std::ceil(left), crop.width),
                static_cast<uint16_t>(tile_of(right, crop.width) + 1),
                tile_of(std::ceil(top), crop.height),
                static_cast<uint16_t>(tile_of(bottom, crop.height) + 1)};
    depth_keys[i] = std::bit_cast<uint32_t>(at.depth);
  }
}

// Sorts by depth, then counts and fills every tile's list in that order.
template <class Scalar>
void Splatter<Scalar>::Impl::bin() {
  order.clear();
  for (uint32_t i = 0; i < gaussians.count; ++i) {
    if (depth_keys[i] != kNotVisible) order.push_back({depth_keys[i], i});
  }
  radix_sort(order, sort_scratch);
  tile_first.assign(size_t(tiles_x) * tiles_y + 1, 0);
  uint32_t total = 0;
  for (const SortItem& item : order) {
    const TileBox& box = boxes[item.gaussian];
    for (uint32_t y = box.y0; y < box.y1; ++y) {
      for (uint32_t x = box.x0; x < box.x1; ++x) ++tile_first[y * tiles_x + x + 1];
    }
    slot_first[item.gaussian] = total;
    slot_count[item.gaussian] = uint32_t(box.x1 - box.x0) * uint32_t(box.y1 - box.y0);
    total += slot_count[item.gaussian];
  }
  for (size_t t = 1; t < tile_first.size(); ++t) tile_first[t] += tile_first[t - 1];
  tile_cursor.assign(tile_first.begin(), tile_first.end() - 1);
  pairs.resize(total);
  slots.resize(total);
  uint32_t sequence = 0;
  for (const SortItem& item : order) {
    const TileBox& box = boxes[item.gaussian];
    for (uint32_t y = box.y0; y < box.y1; ++y) {
      for (uint32_t x = box.x0; x < box.x1; ++x) {
        const uint32_t slot = tile_cursor[y * tiles_x + x]++;
        pairs[slot] = {item.gaussian, 0, 0};
        slots[sequence++] = slot;
      }
    }
  }
}

template <class Scalar>
TileJob<Scalar> Splatter<Scalar>::Impl::tile_job(uint32_t tile) {
  const uint32_t x = (tile % tiles_x) * kTileSize, y = (tile / tiles_x) * kTileSize;
  return {.x = crop.x + x,
          .y = crop.y + y,
          .width = std::min(kTileSize, crop.width - x),
          .height = std::min(kTileSize, crop.height - y),
          .alpha_cut = Scalar(options.alpha_cut),
          .records = records.data(),
          .pairs = pairs.data() + tile_first[tile],
          .count = tile_first[tile + 1] - tile_first[tile],
          .plane = uint64_t(crop.width) * crop.height,
          .row = crop.width};
}

template <class Scalar>
size_t Splatter<Scalar>::Impl::tile_offset(uint32_t tile) const {
  return size_t(tile / tiles_x) * kTileSize * crop.width + size_t(tile % tiles_x) * kTileSize;
}

template <class Scalar>
void Splatter<Scalar>::Impl::backward_chunk(uint32_t begin, uint32_t end,
                                            const GaussianGradients<Scalar>& gradients) {
  const ProjectionCamera<Scalar> view(camera, options.antialiased);
  const uint32_t sh_stride = 3 * sh_coefficients(gaussians.sh_degree);
  for (uint32_t i = begin; i < end; ++i) {
    Scalar* const position = gradients.position_m + 3 * size_t(i);
    Scalar* const factor = gradients.covariance_factor + 9 * size_t(i);
    Scalar* const sh = gradients.sh + sh_stride * size_t(i);
    Scalar sums[kPairSums] = {};
    bool touched = false;
    if (depth_keys[i] != kNotVisible) {
      for (uint32_t n = 0; n < slot_count[i]; ++n) {
        const uint32_t slot = slots[slot_first[i] + n];
        if (pairs[slot].blocks == 0) continue;
        touched = true;
        for (uint32_t k = 0; k < kPairSums; ++k) sums[k] += pair_sums[size_t(slot) * kPairSums + k];
      }
    }
    if (!touched) {
      std::fill_n(position, 3, Scalar(0));
      std::fill_n(factor, 9, Scalar(0));
      std::fill_n(sh, sh_stride, Scalar(0));
      gradients.opacity[i] = 0;
      continue;
    }
    const Scalar* const at_position = gaussians.position_m + 3 * size_t(i);
    Projected<Scalar> at;
    project(view, at_position, gaussians.covariance_factor + 9 * size_t(i), at);
    // power = -(P t^2 + Q dy^2), t = dx - K dy, dx = x - mean_x, dy = y - mean_y
    const Scalar p = Scalar(0.5) * at.c / at.determinant, k = at.b / at.c, q = Scalar(0.5) / at.c;
    const ProjectedGradient<Scalar> gradient{
        .mean = {2 * p * sums[kSumST], 2 * (q * sums[kSumSY] - p * k * sums[kSumST])},
        .p = -sums[kSumSTT],
        .k = 2 * p * sums[kSumSTY],
        .q = -sums[kSumSYY],
        .log_compensation = options.antialiased ? sums[kSumS] : Scalar(0)};
    project_backward(view, at, gradient, position, factor);
    const Scalar rgb[3] = {records[i].red, records[i].green, records[i].blue};
    sh_colour_backward(view, gaussians.sh_degree, at_position, gaussians.sh + sh_stride * size_t(i),
                       rgb, sums + kSumRed, sh, position);
    // alpha is proportional to opacity, antialiased or not
    gradients.opacity[i] = sums[kSumS] / gaussians.opacity[i];
  }
}

template <class Scalar>
Splatter<Scalar>::Splatter(const SplatterOptions& options)
    : impl_(std::make_unique<Impl>(options)) {}
template <class Scalar>
Splatter<Scalar>::~Splatter() = default;
template <class Scalar>
Splatter<Scalar>::Splatter(Splatter&&) noexcept = default;

template <class Scalar>
void Splatter<Scalar>::forward(const GaussianArrays<Scalar>& gaussians, const Camera& camera,
                               const PixelRect& crop, Scalar* image) {
  FIG_CHECK(crop.width > 0 && crop.height > 0 && crop.x + crop.width <= camera.width_px &&
                crop.y + crop.height <= camera.height_px,
            "the crop must lie within the image");
  FIG_CHECK(gaussians.sh_degree <= kMaxShDegree, "SH degree");
  Impl& s = *impl_;
  s.gaussians = gaussians;
  s.camera = camera;
  s.crop = crop;
  s.tiles_x = (crop.width + kTileSize - 1) / kTileSize;
  s.tiles_y = (crop.height + kTileSize - 1) / kTileSize;
  s.records.resize(gaussians.count);
  s.boxes.resize(gaussians.count);
  s.depth_keys.resize(gaussians.count);
  s.slot_first.resize(gaussians.count);
  s.slot_count.resize(gaussians.count);
  const uint32_t chunks = (gaussians.count + kChunk - 1) / kChunk;
  parallel_for(s.options.threads, chunks, [&](uint32_t c) {
    s.project_chunk(c * kChunk, std::min(gaussians.count, (c + 1) * kChunk));
  });
  s.bin();
  const uint32_t tiles = s.tiles_x * s.tiles_y;
  s.tile_evaluations.assign(tiles, 0);
  const SplatKernels<Scalar>& kernel = kernels<Scalar>();
  parallel_for(s.options.threads, tiles, [&](uint32_t tile) {
    const TileJob<Scalar> job = s.tile_job(tile);
    kernel.find_blocks(job);
    s.tile_evaluations[tile] = kernel.forward_tile(job, image + s.tile_offset(tile));
  });
  s.statistics = {.visible = s.order.size(), .pairs = s.pairs.size(), .blocks = 0};
  for (uint64_t evaluations : s.tile_evaluations) s.statistics.blocks += evaluations;
}

template <class Scalar>
void Splatter<Scalar>::backward(const Scalar* image, const Scalar* image_gradient,
                                const GaussianGradients<Scalar>& gradients) {
  Impl& s = *impl_;
  s.pair_sums.resize(s.pairs.size() * kPairSums);
  const SplatKernels<Scalar>& kernel = kernels<Scalar>();
  parallel_for(s.options.threads, s.tiles_x * s.tiles_y, [&](uint32_t tile) {
    const TileJob<Scalar> job = s.tile_job(tile);
    if (job.count == 0) return;
    const size_t offset = s.tile_offset(tile);
    kernel.backward_tile(job, image + offset, image_gradient + offset,
                         s.pair_sums.data() + size_t(s.tile_first[tile]) * kPairSums);
  });
  const uint32_t count = s.gaussians.count, chunks = (count + kChunk - 1) / kChunk;
  parallel_for(s.options.threads, chunks, [&](uint32_t c) {
    s.backward_chunk(c * kChunk, std::min(count, (c + 1) * kChunk), gradients);
  });
}

template <class Scalar>
const SplatterStatistics& Splatter<Scalar>::statistics() const {
  return impl_->statistics;
}

template class Splatter<float>;
template class Splatter<double>;

}  // namespace figurine::model
