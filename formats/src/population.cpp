#include "figurine/population.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "figurine/check.h"
#include "figurine/detail/rans.h"

namespace figurine {

namespace {

struct Counts {
  size_t weights = 0, rows = 0;  // W, R
};

Counts count(const Network& network) {
  Counts counts;
  for (const Layer& layer : network.layers) {
    counts.weights += layer.weights.size();
    counts.rows += layer.bias.size();
  }
  return counts;
}

std::span<const uint8_t> stream_of(std::span<const uint8_t> code,
                                   std::span<const uint32_t> code_end, size_t member) {
  const size_t begin = member == 0 ? 0 : code_end[member - 1];
  return code.subspan(begin, code_end[member] - begin);
}

size_t static_values(const StaticPart& part) {
  size_t count = 0;
  for (const StaticGroup& group : part.groups) count += group.values.size();
  return count;
}

// out = initial + scale q, convolution by convolution.
void add_int8(const Population& population, size_t member, std::span<const float> scale,
              std::span<float> out) {
  RansDecoder decoder(stream_of(population.code, population.code_end, member));
  size_t at = 0, row = 0, convolution = 0;
  for (const Layer& layer : population.network.layers) {
    if (layer.op != LayerOp::kConv2d) continue;
    const RansTable table(population.frequency.subspan(convolution++ * kRansValues, kRansValues));
    const size_t row_size = layer.weights.size() / layer.bias.size();
    for (size_t k = 0; k < layer.weights.size(); ++k, ++at) {
      out[at] =
          layer.weights[k] + scale[row + k / row_size] * static_cast<float>(decoder.next(table));
    }
    row += layer.bias.size();
  }
}

void add_half(const Population& population, std::span<const Half> difference,
              std::span<float> out) {
  size_t at = 0;
  for (const Layer& layer : population.network.layers) {
    for (const float initial : layer.weights) {
      out[at] = initial + to_float(difference[at]);
      ++at;
    }
  }
}

// The member's integers, [static_values], and its part over them.
StaticPart add_static_values(const Population& population, size_t member,
                             std::span<const float> scale, std::span<int8_t> out) {
  RansDecoder decoder(stream_of(population.static_code, population.static_code_end, member));
  StaticPart part;
  size_t channel = 0;
  for (const StaticGroup& mean : population.static_part.groups) {
    StaticGroup& own = part.groups.emplace_back(mean);
    own.scale = scale.subspan(channel, mean.channels);
    for (uint32_t c = 0; c < mean.channels; ++c) {
      const RansTable table(
          population.static_frequency.subspan((channel + c) * kRansValues, kRansValues));
      for (size_t k = c; k < mean.values.size(); k += mean.channels) {
        const int8_t predicted =
            predict_static(mean.scale[c] * static_cast<float>(mean.values[k]), own.scale[c]);
        out[k] = add_static(predicted, static_cast<int8_t>(decoder.next(table)));
      }
    }
    own.values = out.first(mean.values.size());
    out = out.subspan(mean.values.size());
    channel += mean.channels;
  }
  return part;
}

// The member's row of an array of M equal rows.
template <class T>
std::span<const T> row_of(std::span<const T> array, const Population& population, size_t member) {
  const size_t size = array.size() / population.size();
  return array.subspan(member * size, size);
}

}  // namespace

const char* to_string(DifferenceCoding coding) {
  return coding == DifferenceCoding::kInt8   ? "q8"
         : coding == DifferenceCoding::kHalf ? "f16"
                                             : "none";
}

const char* to_string(Split split) {
  return split == Split::kTrain ? "train" : split == Split::kValidation ? "validation" : "test";
}

uint64_t difference_bytes(const Population& population, size_t member) {
  const auto rows = [&](const auto& array) {
    return row_of(array, population, member).size_bytes();
  };
  size_t bytes = rows(population.bias) + rows(population.static_scale);
  if (population.coding == DifferenceCoding::kInt8) {
    bytes +=
        rows(population.scale) + stream_of(population.code, population.code_end, member).size();
  } else if (population.coding == DifferenceCoding::kHalf) {
    bytes += rows(population.difference);
  }
  if (!population.static_part.empty())
    bytes += stream_of(population.static_code, population.static_code_end, member).size();
  return bytes;
}

int8_t predict_static(float mean, float scale) {
  return static_cast<int8_t>(clamp_and_round(mean / scale, -127, 127));
}

int8_t add_static(int8_t predicted, int8_t difference) {
  const int sum = predicted + difference;
  return static_cast<int8_t>(sum > 127 ? sum - 255 : sum < -127 ? sum + 255 : sum);
}

int8_t subtract_static(int8_t value, int8_t predicted) {
  return add_static(value, static_cast<int8_t>(-predicted));
}

void pose_covariance(const Population& population, size_t member, std::span<float> covariance) {
  const size_t n = 3 * population.pose_joints.size();
  FIG_CHECK(covariance.size() == n * n, "a covariance of the listed joints");
  const std::span<const Half> factor = row_of(population.pose_factor, population, member);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      double sum = 0;
      for (size_t k = 0; k <= j; ++k)
        sum +=
            double(to_float(factor[i * (i + 1) / 2 + k])) * to_float(factor[j * (j + 1) / 2 + k]);
      covariance[i * n + j] = covariance[j * n + i] = static_cast<float>(sum);
    }
  }
}

namespace {

// Floats of storage that the member's kernels need.
size_t own_weights(const Population& population) {
  return population.coding == DifferenceCoding::kNone ? 0 : count(population.network).weights;
}

// The member's kernels and biases in place of the initial ones.
void take_weights(const Population& population, size_t member, std::span<float> weights,
                  Network& network) {
  if (population.coding == DifferenceCoding::kNone) return;
  if (population.coding == DifferenceCoding::kInt8) {
    add_int8(population, member, row_of(population.scale, population, member), weights);
  } else {
    add_half(population, row_of(population.difference, population, member), weights);
  }
  const std::span<const float> bias = row_of(population.bias, population, member);
  size_t at = 0, row = 0;
  for (Layer& layer : network.layers) {
    const size_t layer_weights = layer.weights.size(), layer_rows = layer.bias.size();
    layer.weights = weights.subspan(at, layer_weights);
    layer.bias = bias.subspan(row, layer_rows);
    at += layer_weights;
    row += layer_rows;
  }
}

}  // namespace

size_t member_floats(const Population& population) {
  const size_t features = 3 * population.pose_joints.size();
  return own_weights(population) + features * features +
         (static_values(population.static_part) + sizeof(float) - 1) / sizeof(float);
}

Avatar open_member(const Population& population, size_t member, std::span<float> storage) {
  FIG_CHECK(member < population.size(), "a member of the population");
  FIG_CHECK(storage.size() >= member_floats(population), "room for the member's floats");
  const size_t weights = own_weights(population), features = 3 * population.pose_joints.size();
  const PopulationMember& own = population.members[member];
  Avatar avatar;
  avatar.kind() = population.kind();
  avatar.traits() = own.traits();
  avatar.name = own.name;
  avatar.shape = row_of(population.shape, population, member);
  avatar.uv_size = population.uv_size;
  avatar.antialiased = population.antialiased;
  take_weights(population, member, storage.first(weights), avatar.network);
  if (const size_t values = static_values(population.static_part); values > 0) {
    float* const room = storage.subspan(weights + features * features).data();
    avatar.static_part =
        add_static_values(population, member, row_of(population.static_scale, population, member),
                          {reinterpret_cast<int8_t*>(room), values});
  }
  if (features > 0) {
    const std::span<float> covariance = storage.subspan(weights, features * features);
    pose_covariance(population, member, covariance);
    avatar.pose_statistics = {.joints = population.pose_joints,
                              .mean = row_of(population.pose_mean, population, member),
                              .covariance = covariance,
                              .distances = {}};
  }
  return avatar;
}

std::optional<size_t> find_member(const Population& population, std::string_view name_or_number) {
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].name == name_or_number) return m;
  }
  size_t number = 0;
  const char* const end = name_or_number.data() + name_or_number.size();
  const auto parsed = std::from_chars(name_or_number.data(), end, number);
  if (parsed.ec != std::errc{} || parsed.ptr != end || number >= population.size())
    return std::nullopt;
  return number;
}

}  // namespace figurine
