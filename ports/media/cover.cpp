#include "ports/media/cover.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"

namespace figurine::ports {

// step: pixels of the picture from one of the result to the next.
std::vector<CoverScaler::Taps> CoverScaler::taps(uint32_t from, uint32_t to, double step) {
  std::vector<Taps> all(to);
  const double reach = std::max(step, 1.0), middle = 0.5 * from;
  for (uint32_t i = 0; i < to; ++i) {
    // Where its centre lies, in centres of the picture's pixels.
    const double at = middle + (i + 0.5 - 0.5 * to) * step - 0.5;
    const auto low = static_cast<int64_t>(std::floor(at - reach)) + 1,
               high = static_cast<int64_t>(std::ceil(at + reach)) - 1;
    Taps& taps = all[i];
    const int64_t last = int64_t{from} - 1;
    taps.first = static_cast<uint32_t>(std::clamp<int64_t>(low, 0, last));
    taps.weights.assign(static_cast<size_t>(std::clamp<int64_t>(high, 0, last) - taps.first + 1),
                        0);
    double sum = 0;
    for (int64_t k = low; k <= high; ++k) {
      const double weight = 1 - std::abs(static_cast<double>(k) - at) / reach;
      // What lies outside is the border's.
      const auto inside = static_cast<size_t>(std::clamp<int64_t>(k, 0, last) - taps.first);
      taps.weights[inside] += static_cast<float>(weight);
      sum += weight;
    }
    for (float& weight : taps.weights) weight = static_cast<float>(weight / sum);
  }
  return all;
}

void CoverScaler::scale(const ImageU8& picture, ImageU8& covered) {
  FIG_CHECK(picture.sound() && picture.channels == 3 && covered.sound() && covered.channels == 3,
            "two RGB pictures");
  if (picture.width_px != from_width_ || picture.height_px != from_height_ ||
      covered.width_px != width_ || covered.height_px != height_) {
    from_width_ = picture.width_px, from_height_ = picture.height_px;
    width_ = covered.width_px, height_ = covered.height_px;
    const double step = std::min(static_cast<double>(from_width_) / width_,
                                 static_cast<double>(from_height_) / height_);
    columns_ = taps(from_width_, width_, step);
    rows_ = taps(from_height_, height_, step);
    narrowed_.resize(size_t{3} * width_ * from_height_);
  }
  const uint32_t top = rows_.front().first;
  const uint32_t bottom = rows_.back().first + static_cast<uint32_t>(rows_.back().weights.size());
  for (uint32_t y = top; y < bottom; ++y) {
    float* out = &narrowed_[size_t{3} * width_ * y];
    for (const Taps& taps : columns_) {
      float sums[3] = {0, 0, 0};
      const uint8_t* in = picture.at(taps.first, y);
      for (const float weight : taps.weights) {
        for (int c = 0; c < 3; ++c) sums[c] += weight * in[c];
        in += 3;
      }
      out = std::copy_n(sums, 3, out);
    }
  }
  std::vector<float> sums(size_t{3} * width_);
  for (uint32_t y = 0; y < height_; ++y) {
    std::fill(sums.begin(), sums.end(), 0.5f);  // to the nearest code
    uint32_t row = rows_[y].first;
    for (const float weight : rows_[y].weights) {
      const float* const in = &narrowed_[size_t{3} * width_ * row++];
      for (size_t i = 0; i < sums.size(); ++i) sums[i] += weight * in[i];
    }
    uint8_t* const out = covered.at(0, y);
    for (size_t i = 0; i < sums.size(); ++i)
      out[i] = static_cast<uint8_t>(std::clamp(sums[i], 0.0f, 255.0f));
  }
}

}  // namespace figurine::ports
