// Quantisation-aware training: a short fine-tune of a finished run with fake quantisation on, in
// the trainer's own loop with its own loss. Static values are rounded as in a package and stay.
#pragma once

#include <string>

#include "toolchain/quantize/calibration.h"

namespace figurine::quantize {

struct FineTuneOptions {
  CalibrationOptions calibration;
  uint64_t iterations = 400;
  double learning_rate = 2e-4;  // half a cosine down to zero
  uint32_t threads = 1;
  bool quiet = false;
};

struct FineTuned {
  std::string weights;  // file
  Scales scales;        // the weights' own: calibrated before training and kept
};

// Trains RUN/qat, a run of its own that starts from RUN's weights; RUN's stay as they are. What an
// earlier call finished for the same weights and options is used again, what it began is taken up,
// anything else there is thrown away. Throws as train_avatar.
FineTuned fine_tune(train::TrainedAvatar& avatar, const train::RunDirectory& run,
                    const FineTuneOptions& options);

}  // namespace figurine::quantize
