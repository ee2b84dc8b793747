#include "toolchain/measure/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace figurine::measure {

namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

std::vector<double> finite_of(std::span<const double> values) {
  std::vector<double> finite;
  std::copy_if(values.begin(), values.end(), std::back_inserter(finite),
               [](double value) { return std::isfinite(value); });
  return finite;
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t first = 0; first < order.size();) {
    size_t end = first;
    while (end < order.size() && values[order[end]] == values[order[first]]) ++end;
    for (size_t i = first; i < end; ++i)
      ranks[order[i]] = 0.5 * static_cast<double>(first + end - 1);
    first = end;
  }
  return ranks;
}

double correlate(const std::vector<double>& x, const std::vector<double>& y) {
  if (x.size() < 2) return kNothing;
  const double mean_x = mean_of(x), mean_y = mean_of(y);
  double xx = 0, yy = 0, xy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    yy += (y[i] - mean_y) * (y[i] - mean_y);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  return xx > 0 && yy > 0 ? xy / std::sqrt(xx * yy) : kNothing;
}

struct Pairs {
  std::vector<double> x, y;
};

Pairs finite_pairs(std::span<const double> x, std::span<const double> y) {
  Pairs pairs;
  for (size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    pairs.x.push_back(x[i]);
    pairs.y.push_back(y[i]);
  }
  return pairs;
}

}  // namespace

Summary summarise(std::span<const double> values) {
  const std::vector<double> finite = finite_of(values);
  if (finite.empty()) return {0, kNothing, kNothing, kNothing, kNothing};
  const auto [least, greatest] = std::minmax_element(finite.begin(), finite.end());
  const double mean = mean_of(finite);
  double squares = 0;
  for (const double value : finite) squares += (value - mean) * (value - mean);
  return {finite.size(), mean, *least, *greatest,
          std::sqrt(squares / static_cast<double>(finite.size()))};
}

double quantile(std::vector<double> values, double share) {
  values = finite_of(values);
  if (values.empty()) return kNothing;
  std::sort(values.begin(), values.end());
  const double place = std::clamp(share, 0.0, 1.0) * static_cast<double>(values.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

std::vector<size_t> histogram(std::span<const double> values, double low, double high,
                              size_t bins) {
  std::vector<size_t> counts(bins, 0);
  for (const double value : finite_of(values)) {
    const double place = high > low ? (value - low) / (high - low) * static_cast<double>(bins) : 0;
    ++counts[static_cast<size_t>(std::clamp(place, 0.0, static_cast<double>(bins - 1)))];
  }
  return counts;
}

double pearson_correlation(std::span<const double> x, std::span<const double> y) {
  const Pairs pairs = finite_pairs(x, y);
  return correlate(pairs.x, pairs.y);
}

double spearman_correlation(std::span<const double> x, std::span<const double> y) {
  const Pairs pairs = finite_pairs(x, y);
  return correlate(ranks_of(pairs.x), ranks_of(pairs.y));
}

}  // namespace figurine::measure
