#include "toolchain/model/network_adapter.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "toolchain/error.h"
#include "toolchain/random/split_mix.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

// A kernel's stretch of the flat weights, as a matrix; a view.
torch::Tensor matrix_of(const torch::Tensor& weights, const KernelMatrix& kernel) {
  return weights.narrow(0, kernel.begin, kernel.rows * kernel.columns)
      .view({kernel.rows, kernel.columns});
}

// Rows of which a step on every coefficient moves a weight as far as a step on the weight.
torch::Tensor scaled_rows(const torch::Tensor& basis, int64_t rank) {
  const double length = std::sqrt(double(basis.size(1)) / double(rank));
  return basis.narrow(0, 0, rank).mul(length).contiguous();
}

}  // namespace

const char* to_string(AdapterKind kind) {
  switch (kind) {
    case AdapterKind::kResidual:
      return "residual";
    case AdapterKind::kScale:
      return "scale";
    case AdapterKind::kBasis:
      return "basis";
  }
  return "?";
}

KernelBasis find_kernel_basis(const PoseUNet& shared, const std::vector<torch::Tensor>& people,
                              uint32_t rank, std::vector<double>* energy) {
  const torch::NoGradGuard no_gradient;
  if (people.empty()) throw InputError("basis: there must be somebody to find it from");
  const torch::Tensor base = shared.weights().detach().to(torch::kFloat64);
  KernelBasis basis;
  if (energy != nullptr) energy->clear();
  for (const KernelMatrix& kernel : shared.kernels()) {
    torch::Tensor products = torch::zeros({kernel.columns, kernel.columns}, torch::kFloat64);
    for (const torch::Tensor& weights : people) {
      TORCH_CHECK(weights.numel() == base.numel(), "find_kernel_basis: another network's weights");
      const torch::Tensor difference =
          matrix_of(weights.detach().to(torch::kFloat64), kernel) - matrix_of(base, kernel);
      products.add_(at::mm(difference.t(), difference));
    }
    const auto [values, vectors] = at::linalg_eigh(products);  // ascending, in columns
    const int64_t count = std::min(int64_t{rank}, kernel.columns);
    torch::Tensor rows = vectors.t().flip({0}).narrow(0, 0, count).contiguous();
    const torch::Tensor largest = rows.abs().argmax(1, true);
    rows = rows * rows.gather(1, largest).sign();
    if (energy != nullptr) {
      const double all = values.sum().item<double>(),
                   held = values.flip({0}).narrow(0, 0, count).sum().item<double>();
      energy->push_back(all > 0 ? held / all : 1);
    }
    basis.push_back(rows.to(torch::kFloat32));
  }
  return basis;
}

uint64_t factor_count(const PoseUNet& network, AdapterKind kind, uint32_t rank) {
  int64_t count = 0;
  for (const KernelMatrix& kernel : network.kernels()) {
    count += std::min({int64_t{rank}, kernel.rows, kernel.columns}) *
             (kernel.rows + (kind == AdapterKind::kBasis ? 0 : kernel.columns));
  }
  return static_cast<uint64_t>(count);
}

NetworkAdapter::NetworkAdapter(const PoseUNet& network, AdapterOptions options)
    : options_(std::move(options)), base_(network.weights().detach().clone()) {
  const bool by_basis = options_.kind == AdapterKind::kBasis;
  const std::vector<KernelMatrix> kernels = network.kernels();
  if (by_basis && options_.basis.size() != kernels.size())
    throw InputError("basis: of " + std::to_string(options_.basis.size()) +
                     " kernels, the network has " + std::to_string(kernels.size()));
  int64_t end = 0;
  for (size_t l = 0; l < kernels.size(); ++l) {
    const KernelMatrix& kernel = kernels[l];
    Slot slot{.kernel = kernel, .basis = {}, .learns = {}};
    slot.rank = std::min({int64_t{options_.rank}, kernel.rows, kernel.columns});
    if (by_basis) {
      const torch::Tensor& rows = options_.basis[l];
      if (rows.dim() != 2 || rows.size(1) != kernel.columns || rows.size(0) < slot.rank)
        throw InputError("basis: layer " + std::to_string(l) + ": needs " +
                         std::to_string(slot.rank) + " rows of " + std::to_string(kernel.columns) +
                         " values");
      slot.basis = scaled_rows(rows, slot.rank);
    }
    slot.a = end;
    slot.b = slot.a + kernel.rows * slot.rank;
    slot.end = slot.b + (by_basis ? 0 : slot.rank * kernel.columns);
    end = slot.end;
    slots_.push_back(slot);
  }
  factors_ = torch::zeros({end});
  if (!by_basis) draw_factors();
}

void NetworkAdapter::draw_factors() {
  float* const values = factors_.mutable_data_ptr<float>();
  random::SplitMix random(options_.seed);
  for (Slot& slot : slots_) {
    double width = std::sqrt(3.0 / double(slot.rank));  // of variance 1 / rank
    if (options_.kind == AdapterKind::kScale) {
      // A product is of weights, not beside them.
      const double mean_square = matrix_of(base_, slot.kernel).square().mean().item<double>();
      width /= std::max(1e-6, std::sqrt(mean_square));
    }
    for (int64_t i = slot.a; i < slot.b; ++i)
      values[i] = static_cast<float>(width) * random.signed_unit();
    if (options_.kind != AdapterKind::kScale) continue;
    slot.learns = torch::empty({slot.kernel.rows, slot.rank});
    float* const learns = slot.learns.mutable_data_ptr<float>();
    for (int64_t i = 0; i < slot.learns.numel(); ++i)
      learns[i] = random.signed_unit() < 0 ? 0.0f : 1.0f;
  }
}

void NetworkAdapter::set_base(const torch::Tensor& weights) {
  const torch::NoGradGuard no_gradient;
  TORCH_CHECK(weights.numel() == base_.numel(), "NetworkAdapter: weights of another network");
  base_.copy_(weights.detach());
  if (options_.kind == AdapterKind::kScale) draw_factors();  // how wide A is follows from it
}

torch::Tensor NetworkAdapter::a_of(const torch::Tensor& factors, const Slot& slot) const {
  return factors.narrow(0, slot.a, slot.b - slot.a).view({slot.kernel.rows, slot.rank});
}

torch::Tensor NetworkAdapter::b_of(const torch::Tensor& factors, const Slot& slot) const {
  if (slot.basis.defined()) return slot.basis;
  return factors.narrow(0, slot.b, slot.end - slot.b).view({slot.rank, slot.kernel.columns});
}

torch::Tensor NetworkAdapter::basis() const {
  std::vector<torch::Tensor> parts;
  for (const Slot& slot : slots_) {
    if (slot.basis.defined()) parts.push_back(slot.basis.flatten());
  }
  return parts.empty() ? torch::empty({0}) : torch::cat(parts);
}

void NetworkAdapter::fold_into(torch::Tensor& weights) const {
  const torch::NoGradGuard no_gradient;
  TORCH_CHECK(weights.numel() == base_.numel(), "NetworkAdapter: weights of another network");
  weights.copy_(base_);
  for (const Slot& slot : slots_) {
    const torch::Tensor product = at::mm(a_of(factors_, slot), b_of(factors_, slot));
    torch::Tensor kernel = matrix_of(weights, slot.kernel);
    if (options_.kind == AdapterKind::kScale) {
      kernel.mul_(product.add_(1));
    } else {
      kernel.add_(product);
    }
  }
}

torch::Tensor NetworkAdapter::gradients(const torch::Tensor& by_weights) const {
  const torch::NoGradGuard no_gradient;
  TORCH_CHECK(by_weights.numel() == base_.numel(), "NetworkAdapter: gradients of another network");
  torch::Tensor out = torch::empty_like(factors_);
  for (const Slot& slot : slots_) {
    torch::Tensor by_product = matrix_of(by_weights, slot.kernel);
    if (options_.kind == AdapterKind::kScale)
      by_product = by_product * matrix_of(base_, slot.kernel);
    torch::Tensor by_a = at::mm(by_product, b_of(factors_, slot).t());
    if (slot.learns.defined()) by_a.mul_(slot.learns);
    a_of(out, slot).copy_(by_a);
    if (options_.kind != AdapterKind::kBasis)
      b_of(out, slot).copy_(at::mm(a_of(factors_, slot).t(), by_product));
  }
  return out;
}

}  // namespace figurine::model
