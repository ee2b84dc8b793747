#include "samples/common/image_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/check.h"

namespace figurine::samples {

void ErrorSum::add(double difference) {
  squared += difference * difference;
  ++values;
  largest = std::max(largest, std::abs(difference));
}

double ErrorSum::rmse() const {
  return values == 0 ? 0 : std::sqrt(squared / static_cast<double>(values));
}

double ErrorSum::psnr_db() const {
  return squared > 0 ? -20 * std::log10(rmse()) : std::numeric_limits<double>::infinity();
}

void add_foreground_error(const ports::ImageF32& truth, const ports::ImageF32& picture,
                          ErrorSum& sum) {
  FIG_CHECK(
      truth.pixels.size() == picture.pixels.size() && truth.channels == 4 && picture.channels == 4,
      "two RGBA images of one size");
  constexpr double kGrey = 0.5;
  for (size_t i = 0; i + 3 < truth.pixels.size(); i += 4) {
    const float* t = &truth.pixels[i];
    const float* p = &picture.pixels[i];
    if (!(t[3] > 0.5f)) continue;
    for (int c = 0; c < 3; ++c) sum.add((p[c] - kGrey) * p[3] - (t[c] - kGrey) * t[3]);
  }
}

}  // namespace figurine::samples
