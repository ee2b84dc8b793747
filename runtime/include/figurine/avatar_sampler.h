// The device's sampler: a package and a seed in, the weights of an avatar that nobody has seen out.
// The same seed gives the same weights in fixed point on every CPU.
//
//   auto sampler = AvatarSampler::create(package.sampler());
//   SampledAvatar person;
//   (*sampler)->sample({.seed = 7}, person);
//   person.avatar();   // in float and in fixed point: write it (formats/writer) or draw it
//
// No files, no clock, no exceptions. A sampler is used by one thread at a time. The package's bytes
// must outlive it and all that it made; the Package itself need not.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "figurine/detail/fixed_point_weights.h"
#include "figurine/isa.h"
#include "figurine/sampler.h"
#include "figurine/status.h"

namespace figurine {

struct SampleRequest {
  uint64_t seed = 0;
  // The start lies `mix` (0 to 1) of the way from the noise of `seed` to that of `to`, on the arc
  // that keeps it standard normal.
  uint64_t to = 0;
  double mix = 0;
  uint32_t steps = 0;                  // 1 to kMaxSolverSteps; 0: the package's
  std::optional<SolverMethod> method;  // none: the package's
};

// Where a sampled avatar's numbers live. Reused from sample to sample.
class SampledAvatar {
 public:
  // In float and in fixed point. Borrows from here and from the sampler's package.
  const Avatar& avatar() const { return avatar_; }

 private:
  friend class AvatarSampler;
  std::vector<float> weights_;    // [W]
  std::vector<int8_t> integers_;  // of the static part
  FixedPointStorage fixed_point_;
  Avatar avatar_;
};

class AvatarSampler {
 public:
  // Watches a sample become an avatar: after every step, with the avatar that the denoiser believes
  // in by then.
  class Trace {
   public:
    virtual ~Trace() = default;
    // step: from 1. lambda: what has been arrived at. An error ends the sampling and is returned.
    // Called in IEEE 754's default mode of floats, whatever the sampler's caller has.
    virtual Status after_step(uint32_t step, double lambda, const SampledAvatar& avatar) = 0;
  };

  // isa: which kernels run, the same bits with every one; none: the largest set of
  // supported_isas(). kUnsupported for an instruction set that is not there, kOutOfMemory.
  static Result<std::unique_ptr<AvatarSampler>> create(const Sampler& sampler,
                                                       std::optional<Isa> isa = std::nullopt);
  ~AvatarSampler();
  AvatarSampler(const AvatarSampler&) = delete;
  AvatarSampler& operator=(const AvatarSampler&) = delete;

  // kInvalidArgument for steps or a mix out of range; kCorrupt if a prediction or weight is not
  // finite, as of a package that was trained badly. out is then of no use.
  Status sample(const SampleRequest& request, SampledAvatar& out, Trace* trace = nullptr);

  Isa isa() const;                // of the kernels that run
  uint64_t memory_bytes() const;  // beside the package and SampledAvatar
  uint64_t macs_per_evaluation() const;

 private:
  struct Impl;
  explicit AvatarSampler(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace figurine
