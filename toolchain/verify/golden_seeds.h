// What a sampler package's golden seeds are: sampled by the device's own code.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/sampler.h"

namespace figurine::verify {

// Seeds 0, 1, ... by the sampler's own steps and method. sampler: of an opened package. Throws
// InputError if one cannot be sampled.
std::vector<GoldenSeed> sample_golden_seeds(const Sampler& sampler, uint32_t count);

}  // namespace figurine::verify
