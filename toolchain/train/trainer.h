// The paper's first stage: fits one person's UNet to the person's images.
//
// Every iteration draws one image of one training pose: pose maps -> UNet -> Gaussians -> picture
// -> L1 + 0.1 SSIM + 0.1 mask -> optimiser. The picture is cropped to the true mask with a margin;
// every 16th iteration looks at the whole image, so that nothing can hide outside. The paper's
// perceptual term (0.01) is there where a network for it is given. Saves a checkpoint every half
// minute and when interrupted.
//
// Based on: the paper, section 4.1 and implementation details; Pang et al., ASH: Animatable
// Gaussian Splats for Efficient and Photoreal Human Rendering, 2024 (the warm-up).
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "toolchain/train/run_directory.h"
#include "toolchain/train/settings.h"

namespace figurine::model {
struct FakeQuantisation;
class PictureDistance;
}  // namespace figurine::model

namespace figurine::train {

struct TrainRequest {
  std::string data;                    // one identity's folder
  std::vector<std::string> more_data;  // of further people, who share the network with the first
                                       // and take turns; each has static values of its own, and a
                                       // run for evaluation and packing in RUN/NAME OF THE FOLDER
  std::string body;                    // package
  std::string run;                     // folder to write
  TrainSettings settings;
  std::string command;  // as typed, for run.json
  bool resume = false;  // goes on from the run's checkpoint, by the run's own settings; only
                        // settings.threads counts
  bool quiet = false;
  double checkpoint_period_s = 30;
  uint64_t stop_after = 0;  // interrupt before this iteration, as Ctrl-C would; 0: never (tests)
  std::shared_ptr<const model::FakeQuantisation>
      fake_quantisation;  // of the UNet while training; needs settings.bf16 off. Static values are
                          // then rounded as in a package before the first iteration. Null: none
  std::shared_ptr<const model::PictureDistance>
      perceptual;  // the network that settings.perceptual names; null exactly if it names none
  nlohmann::json notes = nlohmann::json::object();  // further entries of a new run's run.json
};

struct TrainResult {
  TrainingState state;
  double loss = 0;  // means over the last iterations
  double psnr_db = 0;
  bool was_finished = false;  // nothing was left to do
};

// Throws InputError (bad input, a run that is already there, no space left, a loss that is not
// finite: the last good checkpoint stays) or Interrupted (state saved).
TrainResult train_avatar(const TrainRequest& request);

// run.json as it describes the person and the body, for evaluation and packing.
struct RunDescription {
  std::string data, body;              // paths
  std::vector<std::string> more_data;  // of further people
  std::string body_hash;
  std::vector<float> shape;
  TrainSettings settings;
  nlohmann::json json;
};
RunDescription read_run(const RunDirectory& run);

}  // namespace figurine::train
