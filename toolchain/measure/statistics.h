// Summaries of lists of numbers for reports. Values that are not finite (not measured) are left
// out.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace figurine::measure {

struct Summary {
  size_t count = 0;
  double mean = 0, least = 0, greatest = 0;
  double standard_deviation = 0;  // of the values themselves: divided by their count
};
Summary summarise(std::span<const double> values);  // NaN where there is none

// The value below which the share of the values lies, interpolated between neighbours. NaN of none.
double quantile(std::vector<double> values, double share);

// Counts in `bins` equal bins from low to high; what lies beyond falls into the end bins.
std::vector<size_t> histogram(std::span<const double> values, double low, double high, size_t bins);

// Of pairs whose both values are finite; NaN below two pairs or without any variance.
double pearson_correlation(std::span<const double> x, std::span<const double> y);
double spearman_correlation(std::span<const double> x,
                            std::span<const double> y);  // of ranks, ties sharing their mean rank

}  // namespace figurine::measure
