// figurine's splatter beside two others on the same Gaussians, one thread, from Gaussians in the
// world to pixels.
//
//   splat_peers SCENE.ply --benchmark_enable_random_interleaving=true --benchmark_repetitions=9
//
// 1024 x 1024 pixels, the scene's height nearly filling them (a standing person, y up). The counter
// psnr_db is the picture against figurine's exact one, over all values of premultiplied colour.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "bench/peers/peer.h"
#include "figurine/renderer.h"
#include "ports/gaussians/ply.h"
#include "ports/host/files.h"

namespace figurine::peers {
namespace {

constexpr uint32_t kSide = 1024;

struct Subject {
  ports::GaussianCloud cloud;
  Camera camera;
  std::vector<float> truth;  // [side,side,3] premultiplied
};

Camera look_at(const ports::GaussianCloud& cloud) {
  float low = 1e30f, high = -1e30f, x = 0, z = 0;
  for (size_t i = 0; i < cloud.count(); ++i) {
    low = std::min(low, cloud.position_m[3 * i + 1]);
    high = std::max(high, cloud.position_m[3 * i + 1]);
    x += cloud.position_m[3 * i], z += cloud.position_m[3 * i + 2];
  }
  const float count = static_cast<float>(cloud.count()), height = high - low;
  constexpr float kFill = 0.9f, kDegrees = 57.2957795f;
  const float distance = height / 0.6f;
  return *make_orbit_camera(
      {.azimuth_deg = 20,
       .elevation_deg = 0,
       .distance_m = distance,
       .vertical_fov_deg = 2 * kDegrees * std::atan(0.5f * height / kFill / distance),
       .target_m = {x / count, 0.5f * (low + high), z / count}},
      kSide, kSide);
}

std::unique_ptr<Renderer> make_renderer(std::optional<Isa> isa) {
  return std::move(
             Renderer::create({.threads = 1, .pool = nullptr, .now_user = nullptr, .isa = isa}))
      .value();
}

Status draw(Renderer& renderer, const Subject& subject, bool fast, const ImageTarget& target) {
  const GaussianView gaussians = subject.cloud.view();
  return renderer.render({.camera = subject.camera,
                          .avatars = {},
                          .gaussians = {&gaussians, 1},
                          .background = std::nullopt,
                          .splat = {},
                          .leave_out = {},
                          .approximation = {.fast_blend = fast}},
                         target);
}

std::vector<float> premultiplied(Renderer& renderer, const Subject& subject, bool fast) {
  std::vector<float> rgba(size_t{4} * kSide * kSide), rgb(size_t{3} * kSide * kSide);
  const Status drawn = draw(
      renderer, subject, fast,
      {.pixels = rgba.data(), .stride_bytes = size_t{16} * kSide, .format = PixelFormat::kRgbaF32});
  FIG_CHECK(drawn.ok(), "the scene can be drawn");
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = rgba[i / 3 * 4 + i % 3] * rgba[i / 3 * 4 + 3];
  return rgb;
}

double psnr_db(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0;
  for (size_t i = 0; i < a.size(); ++i) squares += double(a[i] - b[i]) * double(a[i] - b[i]);
  return -10 * std::log10(squares / static_cast<double>(a.size()) + 1e-30);
}

void time_figurine(benchmark::State& state, const Subject& subject, Isa isa, bool fast) {
  const std::unique_ptr<Renderer> renderer = make_renderer(isa);
  std::vector<uint8_t> rgba(size_t{4} * kSide * kSide);
  for (auto _ : state) {
    const Status drawn =
        draw(*renderer, subject, fast, {.pixels = rgba.data(), .stride_bytes = size_t{4} * kSide});
    benchmark::DoNotOptimize(drawn.ok());
  }
  state.counters["psnr_db"] = psnr_db(premultiplied(*renderer, subject, fast), subject.truth);
  state.counters["blends"] = static_cast<double>(renderer->statistics().blends);
}

void time_peer(benchmark::State& state, const Subject& subject,
               void (*draw_peer)(const GaussianView&, const Camera&, Peer&)) {
  Peer peer;
  for (auto _ : state) {
    draw_peer(subject.cloud.view(), subject.camera, peer);
    benchmark::DoNotOptimize(peer.rgb.data());
  }
  state.counters["psnr_db"] = psnr_db(peer.rgb, subject.truth);
}

void register_all(const Subject& subject) {
  for (const Isa isa : supported_isas()) {
    for (const bool fast : {false, true}) {
      benchmark::RegisterBenchmark(
          (std::string(fast ? "figurine_fast/" : "figurine/") + to_string(isa)).c_str(),
          [&subject, isa, fast](benchmark::State& state) {
            time_figurine(state, subject, isa, fast);
          })
          ->Unit(benchmark::kMillisecond);
    }
  }
  const auto add = [&](const char* name, auto* draw_peer) {
    benchmark::RegisterBenchmark(name, [&subject, draw_peer](benchmark::State& state) {
      time_peer(state, subject, draw_peer);
    })->Unit(benchmark::kMillisecond);
  };
  add("by_gaussian", draw_by_gaussian);
  add("by_rows", draw_by_rows);
}

int run(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (argc != 2) {
    std::fprintf(stderr, "usage: splat_peers SCENE.ply [--benchmark_...]\n");
    return 2;
  }
  const Result<ports::MappedFile> file = ports::MappedFile::open(argv[1]);
  if (!file.ok()) {
    std::fprintf(stderr, "splat_peers: %s\n", file.status().message().c_str());
    return 1;
  }
  auto cloud = ports::read_gaussian_ply(file->bytes(), argv[1]);
  if (!cloud.ok() || cloud->count() == 0 || cloud->sh_degree != 0) {
    std::fprintf(
        stderr, "splat_peers: %s\n",
        cloud.ok() ? "Gaussians of SH degree 0 are needed" : cloud.status().message().c_str());
    return 1;
  }
  Subject subject{.cloud = std::move(*cloud), .camera = {}, .truth = {}};
  subject.camera = look_at(subject.cloud);
  subject.truth = premultiplied(*make_renderer(std::nullopt), subject, false);
  register_all(subject);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace figurine::peers

int main(int argc, char** argv) { return figurine::peers::run(argc, argv); }
