// Milliseconds a layer of an avatar's network, in the very frames in which it runs: 512x512, the
// body framed, a fresh pose each, in fixed point, by one thread.
//
//   layer_times AVATAR FRAMES
//
// Prints one JSON object: medians over the frames, by layer, of the network's stage and of the
// frame. The first and the last convolution are the runtime's own, the others XNNPACK's; asking for
// their times costs it one read of the clock a layer.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/network_profile.h"
#include "figurine/renderer.h"
#include "samples/common/camera_path.h"
#include "samples/common/machine.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"

namespace figurine::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr samples::ImageSize kSize{512, 512};

double median_ms(std::vector<uint64_t> values_ns) {
  const auto middle = values_ns.begin() + static_cast<std::ptrdiff_t>(values_ns.size() / 2);
  std::nth_element(values_ns.begin(), middle, values_ns.end());
  return static_cast<double>(*middle) * 1e-6;
}

Status print_layers(const std::string& avatar, uint32_t frames) {
  Result<samples::Scene> scene = samples::Scene::load({.avatars = {avatar}});
  if (!scene.ok()) return scene.status();
  Result<std::unique_ptr<Renderer>> renderer =
      Renderer::create({.threads = 1, .now_ns = read_stage_clock});
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, Precision::kFixedPoint));
  const Network& network = scene->avatar(0).avatar.network;
  if (network.layers.empty())
    return Status(StatusCode::kMismatch, avatar + ": network: the avatar has none");
  const uint32_t first[] = {0};
  samples::CameraPathOptions path;
  path.size = kSize;
  const Result<std::vector<Camera>> cameras =
      samples::make_camera_path(path, first, *scene, **renderer);
  if (!cameras.ok()) return cameras.status();
  samples::RenderedFrame picture{kSize, PixelFormat::kRgba8};

  std::vector<LayerCost> layers;
  std::vector<std::vector<uint64_t>> layer_ns;
  std::vector<uint64_t> network_ns, frame_ns;
  for (uint32_t moment = 0; moment <= frames; ++moment) {
    FIG_RETURN_IF_ERROR((*renderer)->render({.camera = cameras->front(),
                                             .avatars = scene->sway(moment),
                                             .leave_out = {.unchanged_networks = false}},
                                            picture.target()));
    if (moment == 0) continue;  // to have everything in its place
    Result<std::vector<LayerCost>> run = last_run(network);
    if (!run.ok()) return run.status();
    layers = std::move(*run);
    layer_ns.resize(layers.size());
    for (size_t i = 0; i < layers.size(); ++i) layer_ns[i].push_back(layers[i].count);
    const FrameStatistics& statistics = (*renderer)->statistics();
    network_ns.push_back(statistics.stage_ns[static_cast<size_t>(Stage::kNetwork)]);
    uint64_t sum_ns = 0;
    for (const uint64_t ns : statistics.stage_ns) sum_ns += ns;
    frame_ns.push_back(sum_ns);
  }
  Json json = {{"cpu", samples::cpu_name()},          {"isa", to_string((*renderer)->isa())},
               {"library", network_library()},        {"frames", frames},
               {"network_ms", median_ms(network_ns)}, {"frame_ms", median_ms(frame_ns)}};
  for (size_t i = 0; i < layers.size(); ++i) {
    json["layers"].push_back(
        {{"name", layers[i].name}, {"macs", layers[i].macs}, {"ms", median_ms(layer_ns[i])}});
  }
  std::printf("%s\n", json.dump(1).c_str());
  return {};
}

}  // namespace
}  // namespace figurine::bench

int main(int argc, char** argv) {
  const long frames = argc == 3 ? std::strtol(argv[2], nullptr, 10) : 0;
  if (frames < 1 || frames > 100000) {
    std::fprintf(stderr, "usage: layer_times AVATAR FRAMES\n");
    return 2;
  }
  const figurine::Status status =
      figurine::bench::print_layers(argv[1], static_cast<uint32_t>(frames));
  if (!status.ok()) std::fprintf(stderr, "layer_times: %s\n", status.message().c_str());
  return status.ok() ? 0 : 1;
}
