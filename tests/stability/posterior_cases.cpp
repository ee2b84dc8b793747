// The softmax over training members where its exponents are far beyond what a double can raise e
// to. Only where the toolchain is built.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/stability/rows.h"
#include "toolchain/generate/oracle.h"

namespace figurine::stability {

Rows posterior_at_extreme_levels() {
  generate::RowMatrix members(16, 1000);
  for (Eigen::Index n = 0; n < members.rows(); ++n) {
    for (Eigen::Index d = 0; d < members.cols(); ++d)
      members(n, d) = std::sin(double(1 + n) * double(1 + d));
  }
  const generate::MemberOracle oracle(members);
  Rows rows;
  for (const double lambda :
       {-double(INFINITY), -700.0, -50.0, 50.0, 400.0, 700.0, double(INFINITY)}) {
    const NoiseLevel level = noise_level(lambda);
    size_t not_finite = 0;
    double from_one = 0;
    for (const double size : {0.0, 1.0, 1e6}) {
      const generate::RowVector z = size * members.row(3);
      const generate::Posterior posterior = oracle.posterior(z, level);
      not_finite += !posterior.weights.allFinite() + !std::isfinite(posterior.entropy_nats) +
                    !oracle.predict(z, level).allFinite();
      from_one = std::max(from_one, std::abs(posterior.weights.sum() - 1));
    }
    char name[64];
    std::snprintf(name, sizeof(name), "posterior of 16 members at lambda %g", lambda);
    rows.push_back({name, "results that are not finite", Bound::kAtMost, 0, double(not_finite)});
    rows.push_back(
        {name, "distance of the sum of the weights from 1", Bound::kAtMost, 1e-14, from_one});
  }
  return rows;
}

}  // namespace figurine::stability
