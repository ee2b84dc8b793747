// Samples of a trained denoiser in float: what variants that no device holds are compared by, and
// what the device's integers are held against. The noise of a seed and the solver are the device's
// own.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/src/sample/solver.h"
#include "toolchain/generate/oracle.h"
#include "toolchain/generate/sampler_trainer.h"

namespace figurine::verify {

// A transformer as the solver wants it: S vectors one after the other in one z [S*D], denoised
// together.
class TransformerDenoiser final : public Denoiser<double> {
 public:
  // noise: that the transformer was trained on; levels beyond its ends are told to it as its ends.
  TransformerDenoiser(const generate::Transformer& transformer, const NoiseSchedule& noise,
                      size_t vectors)
      : transformer_(transformer), noise_(noise), vectors_(vectors) {}
  Status predict(std::span<const double> z, const NoiseLevel& level, size_t evaluation,
                 std::span<double> x0) override;

 private:
  const generate::Transformer& transformer_;
  NoiseSchedule noise_;
  size_t vectors_;
};

// The same of the closed-form best denoiser over some members.
class OracleDenoiser final : public Denoiser<double> {
 public:
  OracleDenoiser(const generate::MemberOracle& oracle, size_t vectors)
      : oracle_(oracle), vectors_(vectors) {}
  Status predict(std::span<const double> z, const NoiseLevel& level, size_t evaluation,
                 std::span<double> x0) override;

 private:
  const generate::MemberOracle& oracle_;
  size_t vectors_;
};

struct DrawOptions {
  uint64_t first_seed = 0;
  size_t count = 1;  // S
  uint32_t steps = 20;
  SolverMethod method = SolverMethod::kDpmSolverPlusPlus2M;
};

// Seeds first_seed, first_seed + 1, ...: [S,D] vectors of the denoiser's space. The same seed
// begins with the same noise as on the device. Throws InputError if a value is not finite.
generate::RowMatrix draw_vectors(Denoiser<double>& denoiser, const NoiseSchedule& noise,
                                 size_t dimension, const DrawOptions& options);

// Of a trained sampler, in batches: [S,W] weights.
generate::RowMatrix draw_weights(const generate::TrainedSampler& sampler,
                                 const DrawOptions& options);

}  // namespace figurine::verify
