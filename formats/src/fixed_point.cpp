#include "figurine/fixed_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "figurine/check.h"

namespace figurine {

namespace {

Status corrupt(size_t layer, const std::string& what) {
  return Status(StatusCode::kCorrupt, "fixed point: layer " + std::to_string(layer) + ": " + what);
}

bool is_scale(float scale) {
  return std::isfinite(scale) && scale >= std::numeric_limits<float>::min() && scale < 1e6f;
}

// Largest magnitude of (q - zero_point) of a value.
int64_t largest_step(const FixedPointNetwork& fixed, size_t value) {
  if (value == 0) return kInputMax;
  const int64_t zero = fixed.values[value].zero_point;
  return std::max(kInt8Max - zero, zero - kInt8Min);
}

Status validate_convolution(const Network& network, const FixedPointNetwork& fixed, size_t i,
                            const ValueShape& input) {
  const Layer& layer = network.layers[i];
  const FixedPointConvolution& convolution = fixed.convolutions[i];
  const size_t per_output = size_t(layer.kernel) * layer.kernel * input.channels;
  if (convolution.weights.size() != per_output * layer.out_channels ||
      convolution.weight_scale.size() != layer.out_channels ||
      convolution.bias.size() != layer.out_channels) {
    return corrupt(i, "number of weights does not fit the shape");
  }
  const bool is_last = i + 1 == network.layers.size();
  const int64_t step = largest_step(fixed, layer.inputs[0]);
  for (size_t o = 0; o < layer.out_channels; ++o) {
    const std::string channel = "output " + std::to_string(o) + ": ";
    if (!is_scale(convolution.weight_scale[o]))
      return corrupt(i, channel + "the weights' scale is not finite and positive");
    int64_t bound = std::abs(int64_t{convolution.bias[o]});
    for (size_t k = 0; k < per_output; ++k) {
      const int64_t weight = convolution.weights[o * per_output + k];
      if (weight < -kWeightMax)
        return corrupt(i, channel + "a weight is -128; weights are symmetric");
      bound += std::abs(weight) * step;
    }
    if (bound > std::numeric_limits<int32_t>::max())
      return corrupt(i, channel + "a sum can overflow int32");
    const float input_scale = fixed.values[layer.inputs[0]].scale;
    if (!is_scale(input_scale * convolution.weight_scale[o]))
      return corrupt(i, channel + "the scale of the sums is out of range");
    if (is_last) continue;
    const float multiplier = requantisation_multiplier(input_scale, convolution.weight_scale[o],
                                                       fixed.values[i + 1].scale);
    if (!(multiplier >= 0x1p-32f && multiplier < 256))
      return corrupt(i, channel + "the multiplier is not within 2^-32 and 256");
  }
  return {};
}

struct Map {  // a value being read: [size,size,channels]
  const int8_t* data;
  int64_t size, channels;
};

// Sum over the taps inside the image; outside is zero in reals, so a tap there adds nothing.
// weights: [kernel,kernel,channels] of one output.
template <class Element>
int32_t convolution_sum(const Element* data, int64_t size, int64_t channels, int32_t zero_point,
                        const int8_t* weights, int64_t kernel, int64_t y, int64_t x) {
  int32_t sum = 0;
  for (int64_t ky = 0; ky < kernel; ++ky) {
    const int64_t row = y + ky - kernel / 2;
    if (row < 0 || row >= size) continue;
    for (int64_t kx = 0; kx < kernel; ++kx) {
      const int64_t column = x + kx - kernel / 2;
      if (column < 0 || column >= size) continue;
      const Element* from = data + (row * size + column) * channels;
      const int8_t* weight = weights + (ky * kernel + kx) * channels;
      int32_t tap = 0;
      for (int64_t c = 0; c < channels; ++c)
        tap += (int32_t{from[c]} - zero_point) * int32_t{weight[c]};
      sum += tap;
    }
  }
  return sum;
}

// Calls store(pixel, output, sum) for every output of a convolution.
template <class Store>
void for_each_sum(const Network& network, const FixedPointNetwork& fixed, size_t i,
                  const ValueShape& shape, const int8_t* int8_input, const int16_t* int16_input,
                  const Store& store) {
  const Layer& layer = network.layers[i];
  const FixedPointConvolution& convolution = fixed.convolutions[i];
  const int64_t size = shape.size, channels = shape.channels, kernel = layer.kernel;
  const int32_t zero_point = fixed.values[layer.inputs[0]].zero_point;
  for (int64_t y = 0; y < size; ++y) {
    for (int64_t x = 0; x < size; ++x) {
      for (size_t o = 0; o < layer.out_channels; ++o) {
        const int8_t* weights = convolution.weights.data() + o * size_t(kernel * kernel * channels);
        const int32_t sum =
            int16_input != nullptr
                ? convolution_sum(int16_input, size, channels, 0, weights, kernel, y, x)
                : convolution_sum(int8_input, size, channels, zero_point, weights, kernel, y, x);
        store(size_t(y * size + x), o, convolution.bias[o] + sum);
      }
    }
  }
}

void max_pool(const Map& in, std::vector<int8_t>& out) {
  const int64_t size = in.size / 2;
  for (int64_t y = 0; y < size; ++y) {
    for (int64_t x = 0; x < size; ++x) {
      for (int64_t c = 0; c < in.channels; ++c) {
        const auto at = [&](int64_t dy, int64_t dx) {
          return in.data[((2 * y + dy) * in.size + 2 * x + dx) * in.channels + c];
        };
        out[size_t((y * size + x) * in.channels + c)] =
            std::max({at(0, 0), at(0, 1), at(1, 0), at(1, 1)});
      }
    }
  }
}

// Output 2y lies a quarter of an input pixel before input y, output 2y + 1 a quarter after: 3/4 of
// the near one, 1/4 of the far one.
void upsample(const Map& in, std::vector<int8_t>& out) {
  const int64_t size = in.size * 2;
  const auto far = [&](int64_t i) {
    return std::clamp<int64_t>(i % 2 == 0 ? i / 2 - 1 : i / 2 + 1, 0, in.size - 1);
  };
  for (int64_t y = 0; y < size; ++y) {
    for (int64_t x = 0; x < size; ++x) {
      for (int64_t c = 0; c < in.channels; ++c) {
        const auto at = [&](int64_t row, int64_t column) {
          return int32_t{in.data[(row * in.size + column) * in.channels + c]};
        };
        const int32_t sum = 9 * at(y / 2, x / 2) + 3 * at(y / 2, far(x)) + 3 * at(far(y), x / 2) +
                            at(far(y), far(x));
        out[size_t((y * size + x) * in.channels + c)] = static_cast<int8_t>((sum + 8) >> 4);
      }
    }
  }
}

void concatenate(const Map& a, const Map& b, std::vector<int8_t>& out) {
  auto to = out.begin();
  for (int64_t pixel = 0; pixel < a.size * a.size; ++pixel) {
    to = std::copy_n(a.data + pixel * a.channels, a.channels, to);
    to = std::copy_n(b.data + pixel * b.channels, b.channels, to);
  }
}

}  // namespace

Status validate_quantisation(const Network& network, std::span<const Quantisation> values) {
  const Result<std::vector<ValueShape>> shapes = infer_shapes(network, false);
  if (!shapes.ok()) return shapes.status();
  const size_t count = network.layers.size();
  if (values.size() != count)
    return Status(StatusCode::kCorrupt, "fixed point: not one entry per layer");
  for (size_t value = 0; value < count; ++value) {
    const auto& [scale, zero_point] = values[value];
    const std::string name = "fixed point: value " + std::to_string(value) + ": ";
    if (!is_scale(scale))
      return Status(StatusCode::kCorrupt, name + "the scale is not finite and positive");
    if (zero_point < kInt8Min || zero_point > kInt8Max || (value == 0 && zero_point != 0)) {
      return Status(StatusCode::kCorrupt, name + "the zero point is out of range");
    }
  }
  if (network.layers.back().op != LayerOp::kConv2d || network.layers.back().relu) {
    return corrupt(count - 1, "the last layer is not a convolution without ReLU");
  }
  for (size_t i = 0; i < count; ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op == LayerOp::kConv2d) continue;
    const bool two = layer.op == LayerOp::kConcat;
    if (layer.inputs[0] == 0 || (two && layer.inputs[1] == 0))
      return corrupt(i, "reads the int16 input; only convolutions can");
    if (values[layer.inputs[0]] != values[i + 1] ||
        (two && values[layer.inputs[1]] != values[i + 1])) {
      return corrupt(i, "inputs and output do not share one quantisation");
    }
  }
  return {};
}

Status validate_fixed_point(const Network& network, const FixedPointNetwork& fixed) {
  FIG_RETURN_IF_ERROR(validate_quantisation(network, fixed.values));
  const size_t count = network.layers.size();
  if (fixed.convolutions.size() != count)
    return Status(StatusCode::kCorrupt, "fixed point: not one entry per layer");
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  for (size_t i = 0; i < count; ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op == LayerOp::kConv2d)
      FIG_RETURN_IF_ERROR(validate_convolution(network, fixed, i, shapes[layer.inputs[0]]));
  }
  return {};
}

FixedPointValues evaluate_fixed_point(const Network& network, const FixedPointNetwork& fixed,
                                      std::span<const int16_t> input) {
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  FIG_CHECK(fixed.convolutions.size() == network.layers.size() &&
                fixed.values.size() == network.layers.size(),
            "one entry per layer");
  FIG_CHECK(input.size() == size_t(shapes[0].size) * shapes[0].size * shapes[0].channels,
            "the input's size");
  FixedPointValues out;
  out.values.resize(shapes.size());
  const auto map = [&](uint32_t value) {
    return Map{out.values[value].data(), int64_t(shapes[value].size),
               int64_t(shapes[value].channels)};
  };
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    const bool is_last = i + 1 == network.layers.size();
    const size_t elements =
        size_t(shapes[i + 1].size) * shapes[i + 1].size * shapes[i + 1].channels;
    std::vector<int8_t>& to = out.values[i + 1];
    if (!is_last) to.resize(elements);
    switch (layer.op) {
      case LayerOp::kConv2d: {
        const FixedPointConvolution& convolution = fixed.convolutions[i];
        const float input_scale = fixed.values[layer.inputs[0]].scale;
        const int8_t* int8_input = out.values[layer.inputs[0]].data();
        const int16_t* int16_input = layer.inputs[0] == 0 ? input.data() : nullptr;
        if (is_last) {
          out.result.resize(elements);
          for_each_sum(network, fixed, i, shapes[layer.inputs[0]], int8_input, int16_input,
                       [&](size_t pixel, size_t o, int32_t sum) {
                         out.result[pixel * layer.out_channels + o] =
                             static_cast<float>(sum) * (input_scale * convolution.weight_scale[o]);
                       });
          break;
        }
        const Quantisation& quantisation = fixed.values[i + 1];
        const int32_t lowest = layer.relu ? quantisation.zero_point : kInt8Min;
        for_each_sum(network, fixed, i, shapes[layer.inputs[0]], int8_input, int16_input,
                     [&](size_t pixel, size_t o, int32_t sum) {
                       const float multiplier = requantisation_multiplier(
                           input_scale, convolution.weight_scale[o], quantisation.scale);
                       to[pixel * layer.out_channels + o] =
                           requantise(sum, multiplier, quantisation.zero_point, lowest);
                     });
        break;
      }
      case LayerOp::kMaxPool2:
        max_pool(map(layer.inputs[0]), to);
        break;
      case LayerOp::kUpsample2:
        upsample(map(layer.inputs[0]), to);
        break;
      case LayerOp::kConcat:
        concatenate(map(layer.inputs[0]), map(layer.inputs[1]), to);
        break;
    }
  }
  return out;
}

}  // namespace figurine
