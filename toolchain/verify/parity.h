// Holds a package against the trainer: the runtime's picture beside the trainer's, in float, before
// any rounding to 8 bits. The only folder of the toolchain that links the runtime.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::verify {

struct ParityView {
  std::string frame, camera;
  double psnr_db = 0;  // over pixels whose alpha in the trainer's picture exceeds 0.5; RGB over
                       // mid-grey and alpha
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
  Precision precision =
      Precision::kFloat32;  // in fixed point the trainer's UNet imitates the package's integers
};

// device: the package's avatar, or a population's member. Throws InputError if it is not of this
// run's body, does not hold the precision, or the runtime refuses it.
ParityReport compare_with_runtime(train::TrainedAvatar& avatar, const Avatar& device,
                                  const ParityOptions& options);

// What a device says of a package: its golden frame drawn by the runtime, in every precision that
// the package holds.
struct GoldenRun {
  uint64_t memory_bytes =
      0;  // of one instance after a frame, in the greedier precision: peak_memory_bytes
  std::array<uint64_t, 2> fixed_point_hash{0, 0};  // zero without a network in fixed point
  std::string library;                             // that evaluated it
};
GoldenRun draw_golden_frame(const Package& avatar, const Package& body);

}  // namespace figurine::verify
