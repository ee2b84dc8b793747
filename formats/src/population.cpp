#include "figurine/population.h"

#include <charconv>

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

std::span<const uint8_t> stream_of(const Population& population, size_t member) {
  const size_t begin = member == 0 ? 0 : population.code_end[member - 1];
  return population.code.subspan(begin, population.code_end[member] - begin);
}

// out = initial + scale q, convolution by convolution.
void add_int8(const Population& population, size_t member, std::span<const float> scale,
              std::span<float> out) {
  RansDecoder decoder(stream_of(population, member));
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

// The member's row of an array of M equal rows.
template <class T>
std::span<const T> row_of(std::span<const T> array, const Population& population, size_t member) {
  const size_t size = array.size() / population.size();
  return array.subspan(member * size, size);
}

}  // namespace

const char* to_string(DifferenceCoding coding) {
  return coding == DifferenceCoding::kInt8 ? "q8" : "f16";
}

const char* to_string(Split split) {
  return split == Split::kTrain ? "train" : split == Split::kValidation ? "validation" : "test";
}

uint64_t difference_bytes(const Population& population, size_t member) {
  const auto rows = [&](const auto& array) {
    return row_of(array, population, member).size_bytes();
  };
  const size_t differences = population.coding == DifferenceCoding::kInt8
                                 ? rows(population.scale) + stream_of(population, member).size()
                                 : rows(population.difference);
  return rows(population.bias) + differences;
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

size_t member_floats(const Population& population) {
  const size_t features = 3 * population.pose_joints.size();
  return count(population.network).weights + features * features;
}

Avatar open_member(const Population& population, size_t member, std::span<float> storage) {
  FIG_CHECK(member < population.size(), "a member of the population");
  FIG_CHECK(storage.size() >= member_floats(population), "room for the member's floats");
  const Counts counts = count(population.network);
  const std::span<float> weights = storage.first(counts.weights);
  if (population.coding == DifferenceCoding::kInt8) {
    add_int8(population, member, row_of(population.scale, population, member), weights);
  } else {
    add_half(population, row_of(population.difference, population, member), weights);
  }

  const PopulationMember& own = population.members[member];
  Avatar avatar;
  avatar.kind() = population.kind();
  avatar.traits() = own.traits();
  avatar.name = own.name;
  avatar.shape = row_of(population.shape, population, member);
  const std::span<const float> bias = row_of(population.bias, population, member);
  size_t at = 0, row = 0;
  for (Layer& layer : avatar.network.layers) {
    const size_t layer_weights = layer.weights.size(), layer_rows = layer.bias.size();
    layer.weights = weights.subspan(at, layer_weights);
    layer.bias = bias.subspan(row, layer_rows);
    at += layer_weights;
    row += layer_rows;
  }
  if (const size_t features = 3 * population.pose_joints.size(); features > 0) {
    const std::span<float> covariance = storage.subspan(counts.weights, features * features);
    pose_covariance(population, member, covariance);
    avatar.pose_statistics = {population.pose_joints,
                              row_of(population.pose_mean, population, member), covariance};
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
