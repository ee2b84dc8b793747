#include "runtime/src/sample/weight_decoder.h"

#include <algorithm>

#include "figurine/check.h"
#include "figurine/population.h"

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

StaticPart decode_static_part(const Sampler& sampler, std::span<const float> patches,
                              std::vector<int8_t>& integers) {
  size_t count = 0;
  for (const SampledStaticGroup& group : sampler.static_groups)
    count += group.row.size() * group.channels;
  FIG_CHECK(patches.size() == count, "a value for each integer");
  integers.resize(count);
  std::span<int8_t> room = integers;
  StaticPart part;
  for (const SampledStaticGroup& group : sampler.static_groups) {
    const std::span<int8_t> out = room.first(group.row.size() * group.channels);
    room = room.subspan(out.size());
    for (const uint32_t row : group.row) {
      for (uint32_t c = 0; c < group.channels; ++c)
        out[size_t{row} * group.channels + c] = predict_static(patches[c], group.scale[c]);
      patches = patches.subspan(group.channels);
    }
    part.groups.push_back({.first_channel = group.first_channel,
                           .channels = group.channels,
                           .grid_size = group.grid_size,
                           .values = out,
                           .scale = group.scale});
  }
  return part;
}

}  // namespace figurine
