#include "toolchain/train/static_map.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::train {

namespace {

constexpr float kMost = 127;
constexpr float kAlmost = 0.999f;         // of a bound, rounding left aside
constexpr int kCandidates = 40;           // of a scale, from the whole of max|s| down to a half
constexpr float kLeastMagnitude = 1e-6f;  // of a channel that says anything

int8_t round_to(float value, float scale) {
  return static_cast<int8_t>(std::clamp(std::nearbyint(value / scale), -kMost, kMost));
}

// values: the first of a channel's, `stride` apart. bound: of what a package may hold.
float best_scale(const float* values, size_t count, size_t stride, float bound) {
  float largest = 0;
  for (size_t i = 0; i < count; ++i) largest = std::max(largest, std::abs(values[i * stride]));
  if (!(largest > kLeastMagnitude)) return 1 / kMost;  // all are rounded to zero
  largest = std::min(largest, kAlmost * bound);
  float best = 0;
  double least = INFINITY;
  for (int k = 0; k <= kCandidates; ++k) {
    const float scale = largest / kMost * (1 - 0.5f * float(k) / kCandidates);
    double error = 0;
    for (size_t i = 0; i < count; ++i) {
      const float value = values[i * stride];
      const double difference = double(value) - double(scale * float(round_to(value, scale)));
      error += difference * difference;
    }
    if (error < least) least = error, best = scale;
  }
  return best;
}

}  // namespace

StaticMap::StaticMap(const model::HeadComposer& composer) {
  const std::vector<model::StaticChannels>& groups = composer.layout().statics;
  for (size_t g = 0; g < groups.size(); ++g)
    shapes.push_back({composer.static_cells(g), groups[g].count});
  values = torch::zeros({static_cast<int64_t>(composer.static_count())});
}

RoundedMap::RoundedMap(const StaticMap& map, const model::HeadLayout& layout) {
  if (!map.empty() && layout.colour != model::StaticColour::kGain)
    throw InputError("static colours are a sum, an experiment that no package can hold");
  const float* from = map.empty() ? nullptr : map.values.const_data_ptr<float>();
  for (size_t g = 0; g < map.shapes.size(); ++g) {
    const auto cells = static_cast<size_t>(map.shapes[g][0]),
               channels = static_cast<size_t>(map.shapes[g][1]);
    groups_.push_back({.first_channel = layout.statics[g].first,
                       .channels = layout.statics[g].count,
                       .grid_size = layout.statics[g].grid_size,
                       .values = {},
                       .scale = {}});
    begin_.push_back({values_.size(), scale_.size()});
    for (size_t c = 0; c < channels; ++c) {
      const float bound =
          layout.statics[g].first + c < kStaticColour ? kMaxStaticValue : kMaxStaticLogGain;
      scale_.push_back(best_scale(from + c, cells, channels, bound));
    }
    const float* scale = &scale_[begin_.back()[1]];
    for (size_t i = 0; i < cells * channels; ++i)
      values_.push_back(round_to(from[i], scale[i % channels]));
    from += cells * channels;
  }
}

StaticPart RoundedMap::view() const {
  StaticPart part{groups_};
  for (size_t g = 0; g < groups_.size(); ++g) {
    const size_t end = g + 1 < groups_.size() ? begin_[g + 1][0] : values_.size();
    part.groups[g].values = {&values_[begin_[g][0]], end - begin_[g][0]};
    part.groups[g].scale = {&scale_[begin_[g][1]], groups_[g].channels};
  }
  return part;
}

void take_static_part(const StaticPart& part, const model::HeadLayout& layout, StaticMap& map) {
  if (part.groups.size() != map.shapes.size())
    throw InputError("static part: has " + std::to_string(part.groups.size()) + " groups, not " +
                     std::to_string(map.shapes.size()));
  float* to = map.empty() ? nullptr : map.values.mutable_data_ptr<float>();
  for (size_t g = 0; g < part.groups.size(); ++g) {
    const StaticGroup& group = part.groups[g];
    const model::StaticChannels& own = layout.statics[g];
    if (group.first_channel != own.first || group.channels != own.count ||
        group.grid_size != own.grid_size ||
        group.values.size() != static_cast<size_t>(map.shapes[g][0] * map.shapes[g][1]) ||
        group.scale.size() != group.channels) {
      throw InputError("static part: group " + std::to_string(g) + " is of another layout");
    }
    for (size_t i = 0; i < group.values.size(); ++i)
      *to++ = group.scale[i % group.channels] * float(group.values[i]);
  }
}

}  // namespace figurine::train
