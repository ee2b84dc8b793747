#include "toolchain/generate/tensors.h"

#include "toolchain/random/counter.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generate {

torch::Tensor to_tensor(const measure::RowMatrix& rows) {
  const torch::Tensor out = torch::empty({rows.rows(), rows.cols()});
  float* data = out.data_ptr<float>();
  for (Eigen::Index i = 0; i < rows.size(); ++i) data[i] = static_cast<float>(rows.data()[i]);
  return out;
}

measure::RowMatrix to_rows(const torch::Tensor& values) {
  const torch::Tensor own = values.detach().contiguous();
  return Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
             own.const_data_ptr<float>(), own.size(0), own.size(1))
      .cast<double>();
}

torch::Tensor draw_noise(uint64_t seed, uint64_t stream, uint64_t counter, int64_t size) {
  auto generator =
      at::make_generator<at::CPUGeneratorImpl>(random::random_bits(seed, stream, counter));
  return torch::randn({size}, generator);
}

}  // namespace figurine::generate
