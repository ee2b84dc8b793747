#include "toolchain/verify/float_sampler.h"

#include <algorithm>

#include "runtime/src/sample/noise.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::verify {

using generate::RowMatrix;
using generate::RowVector;

namespace {

constexpr size_t kVectorsAtOnce = 64;

}  // namespace

Status TransformerDenoiser::predict(std::span<const double> z, const NoiseLevel& level, size_t,
                                    std::span<double> x0) {
  const torch::NoGradGuard no_gradient;
  const auto vectors = static_cast<int64_t>(vectors_),
             size = static_cast<int64_t>(z.size() / vectors_);
  const torch::Tensor in =
      torch::from_blob(const_cast<double*>(z.data()), {vectors, size}, torch::kFloat64)
          .to(torch::kFloat32);
  const double lambda = std::clamp(level.lambda, noise_.lambda(0), noise_.lambda(1));
  const torch::Tensor out =
      transformer_.forward(in, torch::full({vectors}, lambda, torch::kFloat32))
          .to(torch::kFloat64)
          .contiguous();
  std::copy_n(out.const_data_ptr<double>(), x0.size(), x0.begin());
  return {};
}

Status OracleDenoiser::predict(std::span<const double> z, const NoiseLevel& level, size_t,
                               std::span<double> x0) {
  const size_t size = z.size() / vectors_;
  for (size_t v = 0; v < vectors_; ++v) {
    const RowVector out = oracle_.predict(
        Eigen::Map<const RowVector>(z.data() + v * size, static_cast<Eigen::Index>(size)), level);
    std::copy_n(out.data(), size, x0.begin() + static_cast<ptrdiff_t>(v * size));
  }
  return {};
}

RowMatrix draw_vectors(Denoiser<double>& denoiser, const NoiseSchedule& noise, size_t dimension,
                       const DrawOptions& options) {
  std::vector<float> normal(dimension);
  std::vector<double> z, x0(options.count * dimension), previous_x0(x0.size());
  for (size_t s = 0; s < options.count; ++s) {
    fill_normal(options.first_seed + s, 0, normal);
    z.insert(z.end(), normal.begin(), normal.end());
  }
  std::vector<NoiseLevel> levels(size_t{options.steps} + 1);
  solver_levels(noise, true, levels);
  throw_if_error(solve<double>({.method = options.method}, levels, denoiser, {x0, previous_x0}, z),
                 "sampler");
  return Eigen::Map<RowMatrix>(z.data(), static_cast<Eigen::Index>(options.count),
                               static_cast<Eigen::Index>(dimension));
}

RowMatrix draw_weights(const generate::TrainedSampler& sampler, const DrawOptions& options) {
  const generate::ModelSpace& space = *sampler.space;
  const NoiseSchedule noise = generate::noise_schedule(sampler.settings, space.dimension());
  RowMatrix weights(static_cast<Eigen::Index>(options.count),
                    space.standardisation().mean().size());
  for (size_t done = 0; done < options.count; done += kVectorsAtOnce) {
    DrawOptions part = options;
    part.first_seed += done, part.count = std::min(kVectorsAtOnce, options.count - done);
    TransformerDenoiser denoiser(*sampler.transformer, noise, part.count);
    const RowMatrix vectors = draw_vectors(denoiser, noise, space.size(), part);
    for (Eigen::Index s = 0; s < vectors.rows(); ++s)
      weights.row(static_cast<Eigen::Index>(done) + s) = space.decode(vectors.row(s));
  }
  return weights;
}

}  // namespace figurine::verify
