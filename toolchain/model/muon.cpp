#include "toolchain/model/muon.h"

#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

// Steepest at zero among the quintics whose iteration stays near 1 (Jordan et al.): it does not
// converge to 1, which training does not ask.
constexpr double kA = 3.4445, kB = -4.7750, kC = 2.0315;
constexpr int kIterations = 5;

// Below it the inverse of the norm may be no float: a momentum decays that far where a layer has
// had no gradient for a thousand steps.
constexpr double kSmallNorm = 1e-30;

}  // namespace

torch::Tensor orthogonalised(const torch::Tensor& matrix) {
  torch::NoGradGuard no_gradient;
  const torch::Tensor wide = matrix.to(torch::kDouble);
  const double norm = wide.norm().item<double>();
  if (!(norm > 0)) return torch::zeros_like(matrix);
  torch::Tensor gram = at::mm(wide, wide.t()).div_(norm * norm), product;
  for (int i = 0; i < kIterations; ++i) {
    torch::Tensor step = at::mm(gram, gram).mul_(kC).add_(gram, kB);
    step.diagonal().add_(kA);
    product = product.defined() ? at::mm(step, product) : step;
    // Polynomials of one symmetric matrix commute: step G step.
    if (i + 1 < kIterations) gram = at::mm(step, at::mm(gram, step));
  }
  if (norm < kSmallNorm) return at::mm(product, wide.div(norm)).to(torch::kFloat);
  return at::mm(product.div_(norm).to(torch::kFloat), matrix);
}

}  // namespace figurine::model
