#include "toolchain/train/kernel_basis_file.h"

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/flat_tensor.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/tensor_file.h"
#include "toolchain/train/trainer.h"

namespace figurine::train {

namespace {

std::string basis_name(size_t layer) { return "layer." + std::to_string(layer) + ".basis"; }

}  // namespace

KernelBasisReport make_kernel_basis(const std::string& shared, const std::vector<std::string>& runs,
                                    uint32_t rank, const std::string& path) {
  const TrainSettings settings = read_run({shared}).settings;
  if (!settings.network) throw InputError(shared + ": has no network");
  const model::PoseUNetOptions options{.precision = model::Precision::kFloat32,
                                       .seed = kInitialWeightsSeed};
  model::PoseUNet network(make_network(settings), options), other(make_network(settings), options);
  load_weights(shared, network);
  std::vector<torch::Tensor> people;
  for (const std::string& run : runs) {
    load_weights(run, other);
    people.push_back(other.weights().detach().clone());
  }
  KernelBasisReport report{.people = people.size(), .energy = {}};
  const model::KernelBasis basis = model::find_kernel_basis(network, people, rank, &report.energy);
  TensorFile file;
  for (size_t l = 0; l < basis.size(); ++l) {
    NamedTensor rows = flat_tensor(basis[l].flatten());
    rows.shape = {basis[l].size(0), basis[l].size(1)};
    file.tensors[basis_name(l)] = std::move(rows);
  }
  file.metadata["people"] = std::to_string(people.size());
  write_tensor_file(path, file);
  return report;
}

model::KernelBasis read_kernel_basis(const std::string& path) {
  const TensorFile file = read_tensor_file(path);
  model::KernelBasis basis;
  for (auto found = file.tensors.find(basis_name(0)); found != file.tensors.end();
       found = file.tensors.find(basis_name(basis.size()))) {
    const NamedTensor& rows = found->second;
    if (rows.shape.size() != 2)
      throw InputError(path + ": " + found->first + ": is not rows of values");
    basis.push_back(
        torch::tensor(at::ArrayRef<float>(rows.values)).view({rows.shape[0], rows.shape[1]}));
  }
  if (basis.empty()) throw InputError(path + ": " + basis_name(0) + ": missing");
  return basis;
}

}  // namespace figurine::train
