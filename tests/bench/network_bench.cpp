// One evaluation of the networks of `edge` and `paper`: float, fixed point (exact static ranges),
// and int8 with ranges found at run time.
//
//   network_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=20
//   --benchmark_report_aggregates_only=true
//
// Medians of interleaved repetitions. Arguments: texels a side, channels, threads. "drawn": as an
// avatar uses it, where a body covers 60 % of the map and 20 of 26 channels are constant; otherwise
// every texel and channel.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "bench/dynamic_network.h"
#include "runtime/nn/fixed_point_networks.h"
#include "runtime/src/nn/fixed_point_runner.h"
#include "runtime/src/nn/network_runner.h"

namespace figurine {
namespace {

constexpr uint32_t kChannels = 26, kVarying = 6;

tests::RandomFixedPointNetwork make_network(const benchmark::State& state) {
  return tests::RandomFixedPointNetwork(
      make_pose_unet(static_cast<uint32_t>(state.range(0)), kChannels,
                     static_cast<uint32_t>(state.range(1)), head_channels(0)));
}

ThreadPool make_pool(const benchmark::State& state) {
  return std::move(ThreadPool::create(static_cast<uint32_t>(state.range(2)))).value();
}

void run_float(benchmark::State& state) {
  ThreadPool pool = make_pool(state);
  tests::RandomFixedPointNetwork random = make_network(state);
  std::vector<std::vector<float>> weights;
  for (Layer& layer : random.network.layers) {
    if (layer.op != LayerOp::kConv2d) continue;
    const FixedPointConvolution& convolution =
        random.fixed.convolutions[size_t(&layer - random.network.layers.data())];
    layer.weights = weights.emplace_back(convolution.weights.size(), 0.01f);
    layer.bias = weights.emplace_back(convolution.bias.size(), 0.1f);
  }
  const auto runner = std::move(NetworkRunner::create(random.network, pool)).value();
  for (auto _ : state) FIG_CHECK(runner->run().ok(), "the network runs");
}

void run_fixed_point(benchmark::State& state, bool drawn_alone) {
  ThreadPool pool = make_pool(state);
  const tests::RandomFixedPointNetwork random = make_network(state);
  const uint32_t size = random.network.input_size, varying = drawn_alone ? kVarying : kChannels;
  std::vector<uint32_t> texels(size_t{size} * size * (drawn_alone ? 6 : 10) / 10);
  std::iota(texels.begin(), texels.end(), 0u);
  const std::vector<float> constants = random.input(1, kChannels - varying);
  const auto runner = std::move(FixedPointRunner::create(random.network, random.fixed,
                                                         {.varying_channels = varying,
                                                          .constants = constants,
                                                          .drawn = texels,
                                                          .wanted = texels},
                                                         pool))
                          .value();
  const std::vector<float> input = random.input(2, varying);
  for (const uint32_t texel : texels) {
    std::copy_n(&input[size_t{texel} * varying], varying,
                &runner->input()[size_t{texel} * runner->input_stride()]);
  }
  for (auto _ : state) FIG_CHECK(runner->run().ok(), "the network runs");
  state.counters["macs"] = static_cast<double>(runner->macs());
}

void run_dynamic(benchmark::State& state) {
  ThreadPool pool = make_pool(state);
  const tests::RandomFixedPointNetwork random = make_network(state);
  bench::DynamicNetwork network(random.network, random.fixed, pool);
  const std::vector<float> input = random.input(2, kChannels);
  std::copy(input.begin(), input.end(), network.input().begin());
  for (auto _ : state) network.run();
}

void sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->Args({128, 32, 1})
      ->Args({128, 32, 2})
      ->Args({256, 64, 1})
      ->Args({256, 64, 2})
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

// What a side and channels cost (docs/results/network_cost.json).
void prices(benchmark::internal::Benchmark* benchmark) {
  for (const int64_t size : {32, 64, 128, 256}) {
    for (const int64_t channels : {16, 24, 32, 48, 64}) benchmark->Args({size, channels, 1});
  }
  benchmark->Unit(benchmark::kMillisecond)->UseRealTime();
}

BENCHMARK(run_float)->Name("f32")->Apply(sizes);
BENCHMARK_CAPTURE(run_fixed_point, all, false)->Name("qs8")->Apply(sizes);
BENCHMARK_CAPTURE(run_fixed_point, drawn, true)->Name("qs8 drawn")->Apply(sizes);
BENCHMARK(run_dynamic)->Name("qd8")->Apply(sizes);
BENCHMARK_CAPTURE(run_fixed_point, price, true)->Name("price")->Apply(prices);

}  // namespace
}  // namespace figurine

BENCHMARK_MAIN();
