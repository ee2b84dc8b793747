// Directions of a network's inputs that many people share (model/network_adapter.h), as a file in
// the safetensors layout: layer.N.basis [R,k*k*in], orthonormal rows, the most used first.
#pragma once

#include <string>
#include <vector>

#include "toolchain/model/network_adapter.h"

namespace figurine::train {

// How well a basis holds what it was found from.
struct KernelBasisReport {
  size_t people = 0;
  std::vector<double> energy;  // of every kernel: share of the differences' squares in the rows
};

// Finds the basis of `runs`, weights files or run folders, around the network of the run `shared`
// and writes it. Throws InputError naming file and reason: another network, no runs, no space left.
KernelBasisReport make_kernel_basis(const std::string& shared, const std::vector<std::string>& runs,
                                    uint32_t rank, const std::string& path);

// Throws InputError naming file and tensor.
model::KernelBasis read_kernel_basis(const std::string& path);

}  // namespace figurine::train
