#include "runtime/src/sample/weight_decoder.h"

#include <algorithm>

#include "figurine/check.h"

namespace figurine {

void decode_weights(const Sampler& sampler, std::span<const double> x, std::span<float> weights) {
  FIG_CHECK(x.size() == sampler.direction_scale.size() && weights.size() == sampler.mean.size(),
            "one value a direction, one weight a mean");
  const std::vector<size_t> sizes = sampler_token_sizes(sampler);
  const int8_t* direction = sampler.directions.data();
  float* token = weights.data();
  size_t value = 0;
  for (size_t l = 0; l < sizes.size(); token += sizes[l++]) {
    std::fill_n(token, sizes[l], 0.0f);
    for (uint32_t k = 0; k < sampler.ranks[l]; ++k, ++value, direction += sizes[l]) {
      const float factor = static_cast<float>(x[value]) * sampler.direction_scale[value];
      for (size_t j = 0; j < sizes[l]; ++j) token[j] += factor * static_cast<float>(direction[j]);
    }
  }
  for (size_t j = 0; j < weights.size(); ++j) weights[j] += sampler.mean[j];
}

}  // namespace figurine
