#include "toolchain/model/ssim.h"

#include <algorithm>
#include <cmath>

#include "toolchain/model/parallel.h"
#include "toolchain/model/ssim_kernels.h"

namespace figurine::model {

namespace {

template <class Scalar>
const SsimKernels<Scalar>& kernels();
template <>
const SsimKernels<double>& kernels() {
  return generic::kDoubleSsimKernels;
}
template <>
const SsimKernels<float>& kernels() {
#ifdef FIGURINE_X86_KERNELS
  static const SsimKernels<float>& chosen =
      __builtin_cpu_supports("x86-64-v4")   ? avx512::kFloatSsimKernels
      : __builtin_cpu_supports("x86-64-v3") ? avx2::kFloatSsimKernels
                                            : generic::kFloatSsimKernels;
  return chosen;
#else
  return generic::kFloatSsimKernels;
#endif
}

}  // namespace

template <class Scalar>
double ssim(const PlanarImages<Scalar>& images, uint32_t threads, SsimScratch<Scalar>& scratch,
            Scalar* gradient) {
  const size_t plane = size_t(images.height) * images.width, values = plane * images.channels;
  if (values == 0) return 1;
  double weights[kSsimTaps], sum = 0;
  for (uint32_t k = 0; k < kSsimTaps; ++k)
    sum += weights[k] = std::exp(-0.5 * std::pow((double(k) - kSsimRadius) / 1.5, 2));
  const uint32_t tiles_x = (images.width + kSsimTileColumns - 1) / kSsimTileColumns,
                 tiles_y = (images.height + kSsimTileRows - 1) / kSsimTileRows;
  const uint32_t tiles = tiles_x * tiles_y * images.channels;
  scratch.tile_sums.assign(tiles, 0);
  const auto tile_at = [&](uint32_t index) {
    const uint32_t channel = index / (tiles_x * tiles_y), within = index % (tiles_x * tiles_y);
    const uint32_t column = within % tiles_x * kSsimTileColumns,
                   row = within / tiles_x * kSsimTileRows;
    SsimTile<Scalar> tile{.x = images.x + channel * plane,
                          .y = images.y + channel * plane,
                          .width = images.width,
                          .height = images.height,
                          .column = column,
                          .row = row,
                          .columns = std::min(kSsimTileColumns, images.width - column),
                          .rows = std::min(kSsimTileRows, images.height - row),
                          .window = {},
                          .c1 = Scalar(0.01 * 0.01),
                          .c2 = Scalar(0.03 * 0.03),
                          .gradient = gradient ? gradient + channel * plane : nullptr,
                          .scale = Scalar(1.0 / static_cast<double>(values))};
    for (uint32_t k = 0; k < kSsimTaps; ++k) tile.window[k] = Scalar(weights[k] / sum);
    return tile;
  };
  const SsimKernels<Scalar>& kernel = kernels<Scalar>();
  parallel_for(threads, tiles, [&](uint32_t i) { scratch.tile_sums[i] = kernel.tile(tile_at(i)); });
  double total = 0;
  for (Scalar value : scratch.tile_sums) total += double(value);
  return total / static_cast<double>(values);
}

template double ssim(const PlanarImages<float>&, uint32_t, SsimScratch<float>&, float*);
template double ssim(const PlanarImages<double>&, uint32_t, SsimScratch<double>&, double*);

}  // namespace figurine::model
