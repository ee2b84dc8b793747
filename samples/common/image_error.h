// How far one picture is from another, as docs/numerics.md ("Picture quality") defines it.
#pragma once

#include <cstdint>

#include "ports/media/image.h"

namespace figurine::samples {

// Squared differences of stored colours, pooled over pixels and frames; peak value 1.
struct ErrorSum {
  double squared = 0;
  uint64_t values = 0;
  double largest = 0;

  void add(double difference);
  double rmse() const;
  double psnr_db() const;  // infinity without any difference
};

// Adds the foreground of one frame: pixels whose alpha in the truth exceeds 0.5, both pictures over
// mid-grey. RGBA, straight alpha, equal sizes.
void add_foreground_error(const ports::ImageF32& truth, const ports::ImageF32& picture,
                          ErrorSum& sum);

}  // namespace figurine::samples
