// A network that stays and what one person changes of it. Every kernel is seen as a matrix
// K [out, k*k*in]; K0 is the given network's. Biases stay. r: the rank.
//
//   residual  K = K0 + A B          A [out,r] and B [r,k*k*in] learn
//   scale     K = K0 o (1 + A B)    elementwise; both learn, but for a half of A, the same for
//                                   everybody, which stays as it was drawn: without it two people
//                                   can say one change by different factors
//   basis     K = K0 + A S          A alone learns; S [r,k*k*in], directions of the inputs, is
//                                   given and everybody's. Of two changes no two factors say one
//
// All begin at the given network: B, and A of `basis`, are zero. The result is written into the
// network's own weights, so whatever reads those, files, evaluation and packages, knows nothing of
// factors.
//
// Based on: Hu et al., LoRA: Low-Rank Adaptation of Large Language Models, 2022, section 4.1
// (residual); Yang et al., Weight Space Representation Learning via Neural Field Adaptation, 2026
// (products and the asymmetric mask; theirs is K0 o A B, and pays for where it starts).
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/model/unet.h"
#include "toolchain/tensor.h"

namespace figurine::model {

enum class AdapterKind : uint8_t { kResidual, kScale, kBasis };
const char* to_string(AdapterKind kind);  // "residual", "scale", "basis"

// Of every kernel of a network, in its order: [R,k*k*in] orthonormal rows, the most used first.
using KernelBasis = std::vector<torch::Tensor>;

// The directions that people's kernels differ from the shared network's by: right singular vectors
// of all [people*out, k*k*in] differences of a kernel stacked, at most `rank`, found in double. The
// entry of the largest magnitude of every row is positive. people: [P] float flat weights each, at
// least one. energy, if not null: of every kernel, what share of the differences' squares lies in
// the rows; 1 where there are no differences.
KernelBasis find_kernel_basis(const PoseUNet& shared, const std::vector<torch::Tensor>& people,
                              uint32_t rank, std::vector<double>* energy = nullptr);

struct AdapterOptions {
  AdapterKind kind = AdapterKind::kResidual;
  uint32_t rank = 1;  // of every kernel, where both of its sides are as long
  uint64_t seed = 0;  // of A: the same numbers on every machine
  KernelBasis basis;  // of kBasis: its first `rank` rows count
};

// Q, values of the factors.
uint64_t factor_count(const PoseUNet& network, AdapterKind kind, uint32_t rank);

class NetworkAdapter {
 public:
  // A is drawn uniformly, as wide as makes a step of AdamW on B move a weight as far as a step on
  // the weight itself; the rows of S are as long as makes a step on A do the same. Throws
  // InputError if a basis does not fit the network.
  NetworkAdapter(const PoseUNet& network, AdapterOptions options);

  AdapterKind kind() const { return options_.kind; }
  // [P] float: the network that stays. Whoever loads another one calls set_base.
  const torch::Tensor& base() const { return base_; }
  void set_base(const torch::Tensor& weights);
  // [Q] float, kernel after kernel A, then B, by rows; of kBasis A alone.
  torch::Tensor& factors() { return factors_; }
  const torch::Tensor& factors() const { return factors_; }

  // [sum of r * k*k*in] the rows S of all kernels, scaled; empty but for kBasis.
  torch::Tensor basis() const;

  // weights [P] become the base's, with kernels as above.
  void fold_into(torch::Tensor& weights) const;
  // [Q] dL/dfactors from [P] dL/dweights; zero for what stays of A.
  torch::Tensor gradients(const torch::Tensor& by_weights) const;

 private:
  struct Slot {
    KernelMatrix kernel;
    int64_t rank = 0, a = 0, b = 0, end = 0;  // where A and B begin in the factors
    torch::Tensor basis;                      // [rank,columns] S, of kBasis
    torch::Tensor learns;                     // [rows,rank] 1 or 0: of A, of kScale
  };
  void draw_factors();
  torch::Tensor a_of(const torch::Tensor& factors, const Slot& slot) const;
  torch::Tensor b_of(const torch::Tensor& factors, const Slot& slot) const;

  AdapterOptions options_;
  std::vector<Slot> slots_;  // of the convolutions
  torch::Tensor base_, factors_;
};

}  // namespace figurine::model
