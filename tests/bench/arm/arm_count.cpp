// How many instructions an ARM core executes for a frame of an avatar, by stage, by layer of the
// network, and by kind. scripts/experiments/arm_instructions.sh runs it.
//
//   arm_count AVATAR FRAMES
//
// Frames are those of `figurine bench`: 512x512, the body framed, a fresh pose and a run of the
// network in each, in fixed point, by one thread; the very first is left out. Prints a JSON object
// for each frame, counter and tier, a line each, between a line "begin" and a line "end". Frames
// are drawn once for each counter, which takes the place of the renderer's clock; "clock": false
// are frames without one, of which the total alone is known. Counts need a core emulated by QEMU
// with counting_plugin: exit code 1 without.
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bench/arm/guest.h"
#include "bench/arm/instruction_clock.h"
#include "bench/network_profile.h"
#include "figurine/renderer.h"
#include "samples/common/camera_path.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"

namespace figurine::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr samples::ImageSize kSize{512, 512};

struct Tier {
  const char* name;
  Approximation approximation;
};
constexpr Tier kTiers[] = {{"exact", {}}, {"fast", {.fast_blend = true}}};

// An avatar with a renderer of its own.
struct Stand {
  samples::Scene scene;
  std::unique_ptr<Renderer> renderer;
  Camera camera;
  samples::RenderedFrame picture{kSize, PixelFormat::kRgba8};

  static Result<Stand> open(const std::string& avatar, bool clock);
  Result<Json> draw(uint32_t moment, const Tier& tier, Counter counter, bool clock);
};

Result<Stand> Stand::open(const std::string& avatar, bool clock) {
  Result<samples::Scene> scene = samples::Scene::load({.avatars = {avatar}});
  if (!scene.ok()) return scene.status();
  Result<std::unique_ptr<Renderer>> renderer =
      Renderer::create({.threads = 1, .now_ns = clock ? read_stage_clock : nullptr});
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, Precision::kFixedPoint));
  const uint32_t frames[] = {0};
  samples::CameraPathOptions path;
  path.size = kSize;
  const Result<std::vector<Camera>> cameras =
      samples::make_camera_path(path, frames, *scene, **renderer);
  if (!cameras.ok()) return cameras.status();
  return Stand{
      .scene = std::move(*scene), .renderer = std::move(*renderer), .camera = cameras->front()};
}

Result<Json> Stand::draw(uint32_t moment, const Tier& tier, Counter counter, bool clock) {
  const std::span<const FrameAvatar> posed = scene.sway(moment);
  choose_counter(counter);
  const uint64_t before = read_clock();
  FIG_RETURN_IF_ERROR(renderer->render({.camera = camera,
                                        .avatars = posed,
                                        .leave_out = {.unchanged_networks = false},
                                        .approximation = tier.approximation},
                                       picture.target()));
  const uint64_t total = read_clock() - before;
  Json json = {{"tier", tier.name},
               {"counter", kCounterNames[static_cast<size_t>(counter)]},
               {"frame", moment},
               {"clock", clock},
               {"total", total}};
  if (!clock) return json;
  const FrameStatistics& statistics = renderer->statistics();
  for (size_t stage = 0; stage < kStageCount; ++stage)
    json["stages"][to_string(static_cast<Stage>(stage))] = statistics.stage_ns[stage];
  const Result<std::vector<LayerCost>> layers = last_run(scene.avatar(0).avatar.network);
  if (!layers.ok()) return layers.status();
  json["layers"] = Json::array();
  for (const LayerCost& layer : *layers)
    json["layers"].push_back({{"name", layer.name}, {"macs", layer.macs}, {"count", layer.count}});
  json["work"] = {{"gaussians", statistics.gaussians},
                  {"visible", statistics.visible},
                  {"pairs", statistics.pairs},
                  {"blends", statistics.blends},
                  {"macs", statistics.macs}};
  return json;
}

Status print_frames(Stand& stand, uint32_t frames, const Tier& tier, Counter counter, bool clock) {
  for (uint32_t moment = 1; moment <= frames; ++moment) {
    const Result<Json> json = stand.draw(moment, tier, counter, clock);
    if (!json.ok()) return json.status();
    std::printf("%s\n", json->dump().c_str());
  }
  return {};
}

// Every tier by every counter.
Status print_all(Stand& stand, uint32_t frames, bool clock) {
  for (const Tier& tier : kTiers) {
    // To have everything in its place.
    const Result<Json> first = stand.draw(0, tier, Counter::kInstructions, clock);
    if (!first.ok()) return first.status();
    for (size_t counter = 0; counter < (clock ? kCounters : 1); ++counter)
      FIG_RETURN_IF_ERROR(print_frames(stand, frames, tier, static_cast<Counter>(counter), clock));
  }
  return {};
}

Status count(const std::string& avatar, uint32_t frames) {
  if (read_counters()[0] == 0)
    return Status(StatusCode::kUnsupported, "nothing counts: no counting_plugin");
  std::printf("begin\n");
  for (const bool clock : {false, true}) {
    Result<Stand> stand = Stand::open(avatar, clock);
    if (!stand.ok()) return stand.status();
    if (!clock) {
      std::printf("%s\n", Json{{"isa", to_string(stand->renderer->isa())},
                               {"library", network_library()},
                               {"texels", stand->scene.body(0).package.body().texel_count()}}
                              .dump()
                              .c_str());
    }
    FIG_RETURN_IF_ERROR(print_all(*stand, frames, clock));
  }
  std::printf("end\n");
  return {};
}

}  // namespace
}  // namespace figurine::bench

int main(int argc, char** argv) {
  const figurine::bench::Guest guest;
  const long frames = argc == 3 ? std::strtol(argv[2], nullptr, 10) : 0;
  if (frames < 1 || frames > 1000) {
    std::fprintf(stderr, "usage: arm_count AVATAR FRAMES\n");
    return 2;
  }
  const figurine::Status status = figurine::bench::count(argv[1], static_cast<uint32_t>(frames));
  if (!status.ok()) std::fprintf(stderr, "arm_count: %s\n", status.message().c_str());
  return status.ok() ? 0 : 1;
}
