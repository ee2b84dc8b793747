// Channels of a trained network that are off in every pose: its weights behind them do nothing, and
// training cannot bring them back (a rectifier without input has no gradient).
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/model/unet.h"

namespace figurine::reconstruction {

class IdleChannels {
 public:
  explicit IdleChannels(const model::PoseUNet& unet);

  // input: [T_n,T_n,Cin] of one pose.
  void look_at(const torch::Tensor& input);

  // Of all rectified convolutions.
  uint64_t channels() const { return on_.size(); }
  uint64_t idle() const;  // off in every pose so far; all of them before the first

 private:
  const model::PoseUNet& unet_;
  std::vector<size_t> layers_;  // the rectified ones
  std::vector<bool> on_;        // their channels, layer after layer
};

}  // namespace figurine::reconstruction
