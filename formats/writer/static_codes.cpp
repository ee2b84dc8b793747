#include "formats/writer/static_codes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "figurine/population.h"
#include "formats/writer/rans_encoder.h"

namespace figurine {

bool same_groups(const StaticPart& a, const StaticPart& b) {
  return std::ranges::equal(a.groups, b.groups, [](const StaticGroup& x, const StaticGroup& y) {
    return x.first_channel == y.first_channel && x.channels == y.channels &&
           x.grid_size == y.grid_size && x.values.size() == y.values.size();
  });
}

MeanStaticPart::MeanStaticPart(std::span<const StaticPart* const> parts) {
  const std::vector<StaticGroup>& groups = parts.front()->groups;
  for (size_t g = 0; g < groups.size(); ++g) {
    const size_t count = groups[g].values.size(), channels = groups[g].channels;
    std::vector<double> mean(count);
    for (const StaticPart* part : parts) {
      const StaticGroup& own = part->groups[g];
      for (size_t k = 0; k < count; ++k)
        mean[k] += double(own.scale[k % channels] * static_cast<float>(own.values[k])) /
                   static_cast<double>(parts.size());
    }
    std::vector<float>& scale = scale_.emplace_back(channels);
    for (size_t c = 0; c < channels; ++c) {
      double largest = 0;
      for (size_t k = c; k < count; k += channels) largest = std::max(largest, std::abs(mean[k]));
      scale[c] = std::max(static_cast<float>(largest / 127), std::numeric_limits<float>::min());
    }
    std::vector<int8_t>& values = values_.emplace_back(count);
    for (size_t k = 0; k < count; ++k)
      values[k] = predict_static(static_cast<float>(mean[k]), scale[k % channels]);
  }
  for (size_t g = 0; g < groups.size(); ++g) {
    StaticGroup& group = part_.groups.emplace_back(groups[g]);
    group.values = values_[g];
    group.scale = scale_[g];
  }
}

Result<StaticCodes> encode_static_parts(const StaticPart& mean,
                                        std::span<const StaticPart* const> parts) {
  StaticCodes codes;
  // [M][K] differences of a channel, cell after cell.
  std::vector<std::vector<std::vector<int8_t>>> members;
  for (const StaticPart* part : parts) {
    std::vector<std::vector<int8_t>>& differences = members.emplace_back();
    for (size_t g = 0; g < mean.groups.size(); ++g) {
      const StaticGroup &shared = mean.groups[g], &own = part->groups[g];
      codes.scale.insert(codes.scale.end(), own.scale.begin(), own.scale.end());
      for (uint32_t c = 0; c < own.channels; ++c) {
        std::vector<int8_t>& channel = differences.emplace_back();
        for (size_t k = c; k < own.values.size(); k += own.channels) {
          const float value = shared.scale[c] * static_cast<float>(shared.values[k]);
          channel.push_back(subtract_static(own.values[k], predict_static(value, own.scale[c])));
        }
      }
    }
  }
  std::vector<RansTable> tables;
  for (size_t channel = 0; channel < members.front().size(); ++channel) {
    std::array<uint64_t, kRansValues> counts{};
    for (const auto& member : members) {
      for (const int8_t d : member[channel]) ++counts[static_cast<size_t>(d + 127)];
    }
    const std::array<int16_t, kRansValues> frequency = normalise_counts(counts);
    codes.frequency.insert(codes.frequency.end(), frequency.begin(), frequency.end());
    tables.emplace_back(frequency);
  }
  for (const auto& member : members) {
    std::vector<RansStretch> stretches;
    for (size_t channel = 0; channel < member.size(); ++channel)
      stretches.push_back({member[channel], &tables[channel]});
    const std::vector<uint8_t> stream = encode_rans(stretches);
    codes.code.insert(codes.code.end(), stream.begin(), stream.end());
    if (codes.code.size() > std::numeric_limits<uint32_t>::max()) {
      return Status(StatusCode::kLimitExceeded,
                    "population: its static streams are longer than 4 GiB");
    }
    codes.code_end.push_back(static_cast<uint32_t>(codes.code.size()));
  }
  return codes;
}

}  // namespace figurine
