// The time of every kernel of kernels.inc on random input that stays in the cache, in items a
// second: texels, Gaussians, contributions, pixels or products.
//
//   kernel_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=20
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "runtime/kernels/random_jobs.h"
#include "runtime/src/kernels/table.h"

namespace figurine {
namespace kernels {
#define FIG_KERNEL(Type, operation, isa) Type operation##_##isa;
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
}  // namespace kernels

namespace {

using kernels::kLanes;
using tests::Random;

constexpr size_t kBlocks = 64;

void count_items(benchmark::State& state, double per_iteration) {
  state.counters["items"] =
      benchmark::Counter(per_iteration, benchmark::Counter::kIsIterationInvariantRate);
}

void time_kernel(benchmark::State& state, kernels::BlendTransforms* kernel) {
  constexpr uint32_t kJoints = 55;
  Random random(1);
  std::vector<kernels::TexelBlock> texels(kBlocks);
  for (auto& block : texels) block = kernels::tests::make_texels(random, kJoints);
  std::vector<float> joints(12 * kJoints);
  for (float& value : joints) value = random.uniform(-1, 1);
  std::vector<kernels::TransformBlock> transforms(kBlocks);
  for (auto _ : state) {
    for (size_t i = 0; i < kBlocks; ++i)
      kernel({&texels[i], joints.data(), joints.data(), &transforms[i]});
    benchmark::DoNotOptimize(transforms.data());
  }
  count_items(state, kBlocks * kLanes);
}

void time_kernel(benchmark::State& state, kernels::PoseMaps* kernel) {
  Random random(2);
  std::vector<kernels::TexelBlock> texels(kBlocks);
  std::vector<kernels::TransformBlock> transforms(kBlocks);
  for (auto& block : texels) block = kernels::tests::make_texels(random, 4);
  for (auto& block : transforms) block = kernels::tests::make_transforms(random);
  float maps[kernels::kMapPlanes][kLanes];
  kernels::PoseMapsJob job{.texels = nullptr,
                           .transforms = nullptr,
                           .root_m = {0, 1, 0},
                           .mean = {},
                           .scale = {2, 2, 2, 1, 1, 1},
                           .maps = maps};
  for (auto _ : state) {
    for (size_t i = 0; i < kBlocks; ++i) {
      job.texels = &texels[i];
      job.transforms = &transforms[i];
      kernel(job);
      benchmark::DoNotOptimize(maps);
    }
  }
  count_items(state, kBlocks * kLanes);
}

// Of an avatar as the shipped ones are, or of one with a coarser network, a static part and
// smallest extents.
void time_decode(benchmark::State& state, kernels::DecodeSkin* kernel, bool composed) {
  Random random(3);
  std::vector<kernels::TransformBlock> transforms(kBlocks);
  for (auto& block : transforms) block = kernels::tests::make_transforms(random);
  kernels::CanonicalBlock texels;
  kernels::tests::fill(texels.position_m, random, -1, 1);
  std::fill_n(texels.extent_m, kLanes, 0.005f);
  const kernels::TapBlock taps = kernels::tests::make_taps(random, false);
  const kernels::StaticBlock static_part = kernels::tests::make_static(random, false);
  const kernels::ExtentBlock smallest = kernels::tests::make_extents(random);
  float heads[kLanes][14];
  for (auto& head : heads) {
    for (float& value : head) value = random.normal();
  }
  kernels::GaussianBlock gaussians;
  kernels::DecodeSkinJob job{.head = {},
                             .taps = composed ? &taps : nullptr,
                             .static_part = composed ? &static_part : nullptr,
                             .smallest = composed ? &smallest : nullptr,
                             .texels = &texels,
                             .transforms = nullptr,
                             .offset_scale_m = 0.05f,
                             .max_offset = std::numeric_limits<float>::infinity(),
                             .max_log_scale = 4,
                             .opacity_bias = 2,
                             .sh_values = 3,
                             .gaussians = &gaussians};
  for (uint32_t lane = 0; lane < kLanes; ++lane) {
    for (uint32_t k = 0; k < kernels::kTaps; ++k) job.head[k][lane] = heads[(lane + k) % kLanes];
  }
  for (auto _ : state) {
    for (size_t i = 0; i < kBlocks; ++i) {
      job.transforms = &transforms[i];
      kernel(job);
      benchmark::DoNotOptimize(gaussians);
    }
  }
  count_items(state, kBlocks * kLanes);
}

void time_kernel(benchmark::State& state, kernels::DecodeSkin* kernel) {
  time_decode(state, kernel, false);
}

void time_kernel(benchmark::State& state, kernels::ProjectBlock* kernel) {
  Random random(4);
  std::vector<kernels::GaussianBlock> gaussians(kBlocks);
  for (auto& block : gaussians) block = kernels::tests::make_gaussians(random, false);
  kernels::View view = kernels::tests::make_view(random);
  view.width_px = 512, view.height_px = 512, view.near_m = 0.1f;
  kernels::Splat splats[kLanes];
  float depth_m[kLanes];
  for (auto _ : state) {
    for (size_t i = 0; i < kBlocks; ++i) {
      benchmark::DoNotOptimize(
          kernel({.view = &view,
                  .gaussians = &gaussians[i],
                  .count = kLanes,
                  .sh_degree = 0,
                  .leave_out = kernels::kLeaveOutTransparent | kernels::kLeaveOutOutside,
                  .antialiased = 0,
                  .splats = splats,
                  .depth_m = depth_m}));
    }
  }
  count_items(state, kBlocks * kLanes);
}

template <class... Tier>
void time_blend(benchmark::State& state,
                kernels::BlendedTile (*kernel)(const kernels::BlendTileJob&, Tier...)) {
  Random random(5);
  std::vector<kernels::Splat> splats(300);
  std::vector<uint32_t> order(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    splats[i] = kernels::tests::make_splat(random);
    order[i] = static_cast<uint32_t>(i);
  }
  const auto pixels = std::make_unique<kernels::TilePixels>();
  uint64_t contributions = 0;
  for (auto _ : state) {
    contributions = kernel({.splats = splats.data(),
                            .order = order.data(),
                            .count = static_cast<uint32_t>(order.size()),
                            .x = 0,
                            .y = 0,
                            .width = kernels::kTileSize,
                            .height = kernels::kTileSize,
                            .alpha_cut = 1.0f / 255,
                            .leave_out_stopped = 1,
                            .pixels = pixels.get()},
                           Tier{}...)
                        .contributions;
    benchmark::DoNotOptimize(pixels.get());
  }
  count_items(state, static_cast<double>(contributions));
}

void time_kernel(benchmark::State& state, kernels::BlendTile* kernel) { time_blend(state, kernel); }
void time_kernel(benchmark::State& state, kernels::BlendTileFast* kernel) {
  time_blend(state, kernel);
}

void time_kernel(benchmark::State& state, kernels::ResolveRows* kernel) {
  Random random(6);
  const auto pixels = std::make_unique<kernels::TilePixels>();
  for (int32_t i = 0; i < kernels::kTilePixels; ++i) {
    pixels->red[i] = pixels->green[i] = pixels->blue[i] = random.uniform(0, 1);
    pixels->transmittance[i] = random.uniform(0, 1);
  }
  std::vector<uint8_t> out(size_t{4} * kernels::kTilePixels);
  for (auto _ : state) {
    kernel({.pixels = pixels.get(),
            .first_row = 0,
            .rows = kernels::kTileSize,
            .width = kernels::kTileSize,
            .background = nullptr,
            .format = kernels::kResolveRgba8,
            .out = out.data(),
            .stride_bytes = 4 * kernels::kTileSize});
    benchmark::DoNotOptimize(out.data());
  }
  count_items(state, kernels::kTilePixels);
}

void time_kernel(benchmark::State& state, kernels::AddDots* kernel) {
  constexpr size_t kLength = 288, kCount = 16;  // nine taps of 32 channels to 16 outputs
  alignas(64) static int16_t shared[kLength], rows[kLength * kCount];
  Random random(7);
  for (int16_t& value : shared) value = static_cast<int16_t>(random.uniform(-255, 255));
  for (int16_t& value : rows) value = static_cast<int16_t>(random.uniform(-127, 127));
  int32_t sums[kCount];
  for (auto _ : state) {
    std::fill_n(sums, kCount, 0);
    kernel({shared, rows, kLength, kCount, sums});
    benchmark::DoNotOptimize(sums);
  }
  count_items(state, kLength * kCount);
}

template <class Type>
void add_row(const char* operation, const char* isa_name, Type* kernel) {
  const std::span<const Isa> supported = supported_isas();
  const std::optional<Isa> isa = isa_from_string(isa_name);
  if (!isa || std::find(supported.begin(), supported.end(), *isa) == supported.end()) return;
  benchmark::RegisterBenchmark((std::string(operation) + "/" + isa_name).c_str(),
                               [=](benchmark::State& state) { time_kernel(state, kernel); });
  if constexpr (std::is_same_v<Type, kernels::DecodeSkin>) {
    benchmark::RegisterBenchmark(
        (std::string(operation) + "_composed/" + isa_name).c_str(),
        [=](benchmark::State& state) { time_decode(state, kernel, true); });
  }
}

}  // namespace
}  // namespace figurine

int main(int argc, char** argv) {
  using namespace figurine;
#define FIG_KERNEL(Type, operation, isa) \
  add_row<kernels::Type>(#operation, #isa, kernels::operation##_##isa);
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
