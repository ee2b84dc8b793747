#include "toolchain/verify/posterior_entropy.h"

#include "runtime/src/sample/noise.h"

namespace figurine::verify {

using generate::RowMatrix;
using generate::RowVector;

std::vector<double> posterior_entropy(const RowMatrix& members,
                                      const std::vector<NoiseLevel>& levels,
                                      const EntropyOptions& options) {
  const generate::MemberOracle oracle(members);
  const auto count = static_cast<uint64_t>(members.rows());
  std::vector<double> entropy(levels.size());
  std::vector<float> normal(static_cast<size_t>(members.cols()));
  for (uint32_t draw = 0; draw < options.draws; ++draw) {
    fill_normal(options.seed + draw, 0, normal);
    const RowVector noise =
        Eigen::Map<const Eigen::RowVectorXf>(normal.data(), members.cols()).cast<double>();
    const auto member = members.row(static_cast<Eigen::Index>(draw * count / options.draws));
    for (size_t l = 0; l < levels.size(); ++l) {
      const RowVector z = levels[l].alpha * member + levels[l].sigma * noise;
      entropy[l] += oracle.posterior(z, levels[l]).entropy_nats / options.draws;
    }
  }
  return entropy;
}

}  // namespace figurine::verify
