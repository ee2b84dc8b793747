#include "toolchain/train/describe_run.h"

#include "figurine/network.h"
#include "toolchain/error.h"
#include "toolchain/train/run_directory.h"

namespace figurine::train {

nlohmann::json describe_run(const RunSources& sources, const TrainSettings& settings) {
  const dataset::Dataset& data = *sources.data;
  const Package& body = sources.body->package;
  uint32_t held_out_cameras = 0;
  for (const dataset::CaptureCamera& camera : data.cameras()) held_out_cameras += camera.held_out;
  uint32_t frames[3] = {0, 0, 0};
  for (const dataset::CaptureFrame& frame : data.frames()) ++frames[static_cast<int>(frame.split)];
  const Network network = make_network(settings);
  const uint64_t macs =
      settings.network
          ? count_macs(network, value_or_throw(infer_shapes(network, false), settings.preset))
          : 0;
  return {{"format", kRunFormat},
          {"status", "running"},
          {"tool", "figurine-train " FIGURINE_VERSION},
          {"command", sources.command},
          {"created", utc_now()},
          {"commit", current_commit()},
          {"machine", describe_machine()},
          {"settings", to_json(settings)},
          {"macs_per_frame", macs},
          {"body",
           {{"path", sources.body_path},
            {"name", body.body().name},
            {"hash", format_hash(body.content_hash())}}},
          {"shape", data.shape()},
          {"data",
           {{"path", data.directory()},
            {"seed", data.seed()},
            {"sources", data.sources()},
            {"remarks", data.remarks()},
            {"cameras", data.cameras().size() - held_out_cameras},
            {"held_out_cameras", held_out_cameras},
            {"training_frames", frames[0]},
            {"held_out_frames_interleaved", frames[1]},
            {"held_out_frames_block", frames[2]}}}};
}

}  // namespace figurine::train
