// Holds a package against the trainer: the runtime's picture beside the trainer's, in float, before any rounding to 8 bits. The only folder
// of the toolchain that links the runtime.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::verify {

struct ParityView {
  std::string frame, camera;
  double psnr_db = 0;        // over pixels whose alpha in the trainer's picture exceeds 0.5; RGB over mid-grey and alpha
  double largest_error = 0;  // of any channel of any pixel of the image
  uint64_t foreground = 0;   // pixels
};

struct ParityReport {
  double psnr_db = 0;  // pooled; infinity if every float is equal
  double worst_psnr_db = 0;
  double largest_error = 0;
  std::vector<ParityView> views;
};

struct ParityOptions {
  uint32_t views = 12;  // held-out pictures, spread over frames and cameras
  uint32_t threads = 1;
};

// Throws InputError if the package is not of this run's body, or the runtime refuses it.
ParityReport compare_with_runtime(train::TrainedAvatar& avatar, const Package& package, const ParityOptions& options);

// What the runtime holds for one instance of this avatar after a frame of the given view: the package's peak_memory_bytes.
uint64_t measure_memory(const Package& avatar, const Package& body, const PoseView& pose, const Camera& camera);

}  // namespace figurine::verify
