// The folder that one training leaves behind (docs/training.md):
//
//   run.json                 command, settings, data set, body, machine; when done also iterations,
//                            seconds and where they went
//   log.csv                  iteration, seconds, learning rate, loss, PSNR: means of the iterations
//                            since the row before
//   weights.safetensors      the UNet: layer.N.weight [out,k,k,in] (OHWI), layer.N.bias [out]; and
//                            static.G [M,channels], a static part's values group by group; and
//                            smallest_extent.scale_m [1], .code [N], if the run has such
//   checkpoint.safetensors   the same and what --resume needs: the optimisers' moments, iteration,
//                            seconds; an adapter's base, factors and basis; under person.N. the
//                            static values of the people beyond the first, where several share a
//                            network
//   evaluation.json          by figurine-train evaluate reconstruction
//
// Every file appears whole or not at all, and .safetensors carry checksums (tensor_file.h).
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "toolchain/train/settings.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::model {
class NetworkAdapter;
class Optimiser;
class PoseUNet;
}  // namespace figurine::model

namespace figurine::train {

struct StaticMap;         // static_map.h
class SmallestExtentMap;  // smallest_extent.h

struct RunDirectory {
  std::string path;
  std::string run_json() const { return path + "/run.json"; }
  std::string log() const { return path + "/log.csv"; }
  std::string weights() const { return path + "/weights.safetensors"; }
  std::string checkpoint() const { return path + "/checkpoint.safetensors"; }
  std::string evaluation() const { return path + "/evaluation.json"; }
};

// Where the seconds of training went.
struct StageSeconds {
  double data = 0;  // waiting for the feed
  double unet_forward = 0;
  double compose = 0;  // head from network and static values, forward and backward
  double splat_forward = 0;
  double loss = 0;        // forward and backward: they are fused
  double perceptual = 0;  // its perceptual term, forward and backward
  double splat_backward = 0;
  double unet_backward = 0;
  double optimiser = 0;
  double total() const {
    return data + unet_forward + compose + splat_forward + loss + perceptual + splat_backward +
           unet_backward + optimiser;
  }
};

// What changes while training; with the settings it determines everything that follows.
struct TrainingState {
  uint64_t iteration = 0;  // done so far
  double seconds = 0;      // spent in the loop, all attempts together
  StageSeconds stages;
  std::string settings_hash;  // of what it was trained with; run.json must say the same
};

struct LogRow {
  uint64_t iteration = 0;
  double seconds = 0, learning_rate = 0, loss = 0, psnr_db = 0;
};

// What training changes, and what it found before it began. Borrowed; null (statics: also empty)
// where an avatar has no such part.
struct LearnedParts {
  model::PoseUNet* unet = nullptr;
  StaticMap* statics = nullptr;
  SmallestExtentMap* extents = nullptr;
  model::NetworkAdapter* adapter = nullptr;  // folded into the network; of checkpoints alone
};
// And what changes it.
struct PartOptimisers {
  model::Optimiser* unet = nullptr;  // of the network or of its adapter
  model::Optimiser* statics = nullptr;
};
// Of people beyond the first who share the network.
struct FurtherPerson {
  StaticMap* statics = nullptr;
  model::Optimiser* optimiser = nullptr;
};

void save_weights(const RunDirectory& run, const LearnedParts& parts);
// path: a weights or checkpoint file, or a run folder. Throws InputError naming file and tensor if
// one is missing or a shape differs. What else the file holds is left alone.
void load_weights(const std::string& path, const LearnedParts& parts);
// The network alone.
void load_weights(const std::string& path, model::PoseUNet& unet);
// As load_weights, but static values that the file has none of stay as they are, and so do extents:
// they are of the person, not of the weights.
void load_initial_weights(const std::string& path, const LearnedParts& parts);

void save_checkpoint(const RunDirectory& run, const TrainingState& state, const LearnedParts& parts,
                     const PartOptimisers& optimisers,
                     const std::vector<FurtherPerson>& further = {});
TrainingState load_checkpoint(const RunDirectory& run, const LearnedParts& parts,
                              const PartOptimisers& optimisers,
                              const std::vector<FurtherPerson>& further = {});

void save_log(const RunDirectory& run, const std::vector<LogRow>& rows);
// Rows up to and with `iteration`.
std::vector<LogRow> load_log(const RunDirectory& run, uint64_t iteration);

// Throw InputError naming the file.
nlohmann::json read_json(const std::string& path);
void write_json(const std::string& path, const nlohmann::json& json);
// Of settings as run.json has them, for checkpoints; threads, which may change, left out.
std::string hash_of_settings(nlohmann::json settings);
void make_folder(const std::string& path);  // and those above it; there already: nothing to do

// CPU model, cores, operating system: beside every figure.
nlohmann::json describe_machine();
std::string utc_now();          // 2026-01-31T12:00:00Z
std::string current_command();  // the command line of this process, its program by file name alone
std::string
current_commit();  // $FIGURINE_COMMIT, or .git's of the working directory; "unknown" otherwise

}  // namespace figurine::train
