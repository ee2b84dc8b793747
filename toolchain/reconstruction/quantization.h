// What fixed point costs a trained avatar, in pictures: against the truth, against the float
// network, layer by layer, and as shimmer.
//
// All sweeps run in the trainer's UNet with fake quantisation (equal to the integers to one step a
// value, and a hundred times faster than the reference loops); a few poses go through the integer
// reference itself, and the report states the difference.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "toolchain/quantize/calibration.h"
#include "toolchain/quantize/fine_tune.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::reconstruction {

struct QuantizationOptions {
  quantize::CalibrationOptions
      calibration;  // of the rows that do not name another; its poses count for all
  std::optional<quantize::FineTuneOptions> fine_tune;  // none: no row "qat"
  std::string motion;  // package whose beginning is slowed down; empty: the capture's own frames
  uint32_t views_per_pose = 4;  // cameras of a held-out pose, spread over the list
  uint32_t training_poses = 8;  // seen from the held-out cameras
  uint32_t integer_poses = 2;   // that the integer reference evaluates, too
  bool quiet = false;
};

// One run's report (docs/training.md, "Fixed point"). Throws InputError if nothing is held out.
nlohmann::json evaluate_quantization(train::TrainedAvatar& avatar, const train::RunDirectory& run,
                                     const QuantizationOptions& options);

// Several runs' reports put together: means over the members, worst member named. reports: at least
// one.
nlohmann::json summarise_quantization(const std::vector<nlohmann::json>& reports);

}  // namespace figurine::reconstruction
