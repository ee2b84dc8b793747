#include "toolchain/verify/golden_seeds.h"

#include "figurine/avatar_sampler.h"
#include "figurine/package.h"
#include "toolchain/error.h"

namespace figurine::verify {

std::vector<GoldenSeed> sample_golden_seeds(const Sampler& sampler, uint32_t count) {
  const std::unique_ptr<AvatarSampler> device =
      value_or_throw(AvatarSampler::create(sampler), sampler.name);
  std::vector<GoldenSeed> golden;
  SampledAvatar person;
  const Avatar& avatar = person.avatar();
  for (uint64_t seed = 0; seed < count; ++seed) {
    throw_if_error(device->sample({.seed = seed}, person),
                   sampler.name + ": seed " + std::to_string(seed));
    golden.push_back({.seed = seed,
                      .steps = sampler.steps,
                      .method = sampler.method,
                      .hash = hash_weights(avatar.fixed_point, avatar.shape, avatar.static_part)});
  }
  return golden;
}

}  // namespace figurine::verify
