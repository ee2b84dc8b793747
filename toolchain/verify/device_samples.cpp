#include "toolchain/verify/device_samples.h"

#include <memory>
#include <string>

#include "figurine/avatar_sampler.h"
#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"

namespace figurine::verify {

measure::RowMatrix sample_weights(const Sampler& sampler, const DeviceSamplesOptions& options) {
  const std::unique_ptr<AvatarSampler> device =
      value_or_throw(AvatarSampler::create(sampler), sampler.name);
  measure::RowMatrix weights(static_cast<Eigen::Index>(options.count),
                             static_cast<Eigen::Index>(sampler.mean.size()));
  train::Progress progress("sampling " + sampler.name, options.quiet);
  const train::InterruptGuard interrupt;
  const measure::WeightLayout layout(sampler);
  SampledAvatar person;
  for (size_t i = 0; i < options.count; ++i) {
    if (interrupt.requested())
      throw train::Interrupted("sampling: interrupted, nothing was written");
    const uint64_t seed = options.first_seed + i;
    throw_if_error(device->sample({.seed = seed, .steps = options.steps}, person),
                   sampler.name + ": seed " + std::to_string(seed));
    auto row = weights.row(static_cast<Eigen::Index>(i));
    layout.read(person.avatar(), {row.data(), static_cast<size_t>(row.size())});
    progress.show(static_cast<double>(i + 1) / static_cast<double>(options.count),
                  "seed " + std::to_string(seed));
  }
  return weights;
}

}  // namespace figurine::verify
