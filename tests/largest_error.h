// Collects absolute differences and prints the largest when it goes out of scope, so that limits
// can be tightened. NaN is larger than everything.
#pragma once

#include <cmath>
#include <cstdio>

namespace figurine {

class LargestError {
 public:
  explicit LargestError(const char* what) : what_(what) {}
  LargestError(const LargestError&) = delete;
  ~LargestError() {
    std::printf("largest error, %s: %.3g over %zu values\n", what_, largest_, count_);
  }

  void add(double actual, double expected) { add(actual - expected); }
  void add(double error) {
    if (std::abs(error) > largest_ || std::isnan(error)) largest_ = std::abs(error);
    ++count_;
  }
  double largest() const { return largest_; }  // comparisons with a limit fail if it is NaN

 private:
  const char* what_;
  double largest_ = 0;
  size_t count_ = 0;
};

}  // namespace figurine
