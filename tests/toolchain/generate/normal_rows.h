// Matrices of standard normal values that are the same on every machine.
#pragma once

#include <vector>

#include "runtime/src/sample/noise.h"
#include "toolchain/generate/oracle.h"

namespace figurine::tests {

inline generate::RowMatrix normal_rows(Eigen::Index rows, Eigen::Index columns, uint64_t seed) {
  std::vector<float> values(static_cast<size_t>(rows * columns));
  fill_normal(seed, 0, values);
  return Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
             values.data(), rows, columns)
      .cast<double>();
}

}  // namespace figurine::tests
