// Matrices of standard normal values that are the same on every machine.
#pragma once

#include "figurine/detail/philox.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::tests {

inline measure::RowMatrix random_rows(Eigen::Index rows, Eigen::Index columns, uint64_t seed) {
  measure::RowMatrix values(rows, columns);
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values.data()[i] = stream_normals(seed, 0, uint64_t(i) / 4)[size_t(i) % 4];
  return values;
}

// The rows in the order given.
inline measure::RowMatrix in_order(const measure::RowMatrix& rows,
                                   const std::vector<size_t>& order) {
  measure::RowMatrix chosen(Eigen::Index(order.size()), rows.cols());
  for (size_t i = 0; i < order.size(); ++i)
    chosen.row(Eigen::Index(i)) = rows.row(Eigen::Index(order[i]));
  return chosen;
}

}  // namespace figurine::tests
