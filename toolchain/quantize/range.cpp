#include "toolchain/quantize/range.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/check.h"
#include "figurine/detail/fixed_point_weights.h"

namespace figurine::quantize {

namespace {

constexpr int kCandidates = 100;              // shares of the whole range, in hundredths
constexpr int kSmallestActivationShare = 10;  // an activation's range is not cut below a tenth
constexpr int kSmallestWeightShare = 50;      // nor a weight's below a half
constexpr float kStepsOfRange = float(kInt8Max - kInt8Min);

// Calls score(share) for every candidate and returns the share with the smallest score; the larger
// one of equals.
template <class Score>
float best_share(int smallest, const Score& score) {
  float best = 1;
  double best_score = std::numeric_limits<double>::infinity();
  for (int hundredths = kCandidates; hundredths >= smallest; --hundredths) {
    const float share = static_cast<float>(hundredths) / kCandidates;
    if (const double value = score(share); value < best_score) best_score = value, best = share;
  }
  return best;
}

}  // namespace

void Histogram::widen(float magnitude) {
  if (bins_.empty()) {
    bins_.assign(kBins, 0);
    limit_ = std::numeric_limits<float>::min();
    while (limit_ <= magnitude) limit_ *= 2;
    return;
  }
  while (limit_ <= magnitude) {
    // Bins 2j and 2j + 1, counted outward from zero in the middle, become one.
    std::vector<uint64_t> wider(kBins, 0);
    for (size_t i = 0; i < kBins; ++i) wider[kBins / 4 + i / 2] += bins_[i];
    bins_ = std::move(wider);
    limit_ *= 2;
  }
}

double Histogram::centre(size_t bin) const {
  return (2 * (static_cast<double>(bin) + 0.5) / kBins - 1) * limit_;
}

void Histogram::add(std::span<const float> values) {
  if (values.empty()) return;
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  FIG_CHECK(std::isfinite(*low) && std::isfinite(*high), "finite activations");
  low_ = std::min(low_, *low);
  high_ = std::max(high_, *high);
  widen(std::max(-low_, high_));
  const float to_bin = float(kBins / 2) / limit_;
  for (float value : values) ++bins_[static_cast<size_t>(value * to_bin + float(kBins / 2))];
  count_ += values.size();
}

Range Histogram::percentile(double percent) const {
  FIG_CHECK(percent > 50 && percent < 100, "a percentile between 50 and 100");
  const double outside = static_cast<double>(count_) * (1 - percent / 100);
  Range range;
  double seen = 0;
  for (size_t bin = 0; bin < bins_.size() && seen <= outside; ++bin) {
    range.low = static_cast<float>(centre(bin));
    seen += static_cast<double>(bins_[bin]);
  }
  seen = 0;
  for (size_t bin = bins_.size(); bin-- > 0 && seen <= outside;) {
    range.high = static_cast<float>(centre(bin));
    seen += static_cast<double>(bins_[bin]);
  }
  return {std::clamp(range.low, low_, 0.0f), std::clamp(range.high, 0.0f, high_)};
}

double Histogram::squared_error(const Range& range) const {
  const Quantisation quantisation = quantisation_of(range);
  double error = 0;
  for (size_t bin = 0; bin < bins_.size(); ++bin) {
    if (bins_[bin] == 0) continue;
    const double value = centre(bin);
    const double difference =
        value - dequantise(quantise_int8(static_cast<float>(value), quantisation), quantisation);
    error += static_cast<double>(bins_[bin]) * difference * difference;
  }
  return count_ == 0 ? 0 : error / static_cast<double>(count_);
}

Range Histogram::smallest_error() const {
  const float share = best_share(kSmallestActivationShare,
                                 [&](float s) { return squared_error({s * low_, s * high_}); });
  return {share * low_, share * high_};
}

Quantisation quantisation_of(const Range& range) {
  FIG_CHECK(range.low <= 0 && range.high >= 0, "a range that contains zero");
  const float scale = (range.high - range.low) / kStepsOfRange;
  if (!(scale >= std::numeric_limits<float>::min()))
    return {.scale = 1 / kStepsOfRange, .zero_point = kInt8Min};
  const auto zero_point = static_cast<int32_t>(std::nearbyint(float(kInt8Min) - range.low / scale));
  return {.scale = scale, .zero_point = std::clamp(zero_point, kInt8Min, kInt8Max)};
}

float smallest_error_scale(std::span<const float> weights) {
  const float whole = max_abs_scale(weights);
  if (whole == 0) return 0;
  return whole * best_share(kSmallestWeightShare, [&](float share) {
           const float scale = whole * share;
           double error = 0;
           for (float weight : weights) {
             const double steps =
                 clamp_and_round(weight / scale, -float(kWeightMax), float(kWeightMax));
             error += (weight - steps * scale) * (weight - steps * scale);
           }
           return error;
         });
}

}  // namespace figurine::quantize
