// The network by its definition: loops over every tap, in the scalar type of the caller's choice.
// The truth that XNNPACK is held against.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "figurine/network.h"

namespace figurine::tests {

template <class Scalar>
std::vector<Scalar> convolve(const Layer& layer, const std::vector<Scalar>& input,
                             const ValueShape& shape) {
  const int size = static_cast<int>(shape.size), channels = static_cast<int>(shape.channels),
            kernel = static_cast<int>(layer.kernel);
  std::vector<Scalar> output;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      for (uint32_t o = 0; o < layer.out_channels; ++o) {
        Scalar sum = layer.bias[o];
        for (int ky = 0; ky < kernel; ++ky) {
          for (int kx = 0; kx < kernel; ++kx) {
            const int from_y = y + ky - kernel / 2, from_x = x + kx - kernel / 2;
            if (from_y < 0 || from_y >= size || from_x < 0 || from_x >= size) continue;
            const Scalar* pixel = &input[(size_t(from_y) * size + from_x) * channels];
            const float* weights =
                &layer.weights[((size_t(o) * kernel + ky) * kernel + kx) * channels];
            for (int c = 0; c < channels; ++c) sum += pixel[c] * weights[c];
          }
        }
        output.push_back(layer.relu ? std::max(sum, Scalar(0)) : sum);
      }
    }
  }
  return output;
}

template <class Scalar>
std::vector<Scalar> max_pool(const std::vector<Scalar>& input, const ValueShape& shape) {
  const size_t size = shape.size, channels = shape.channels, half = size / 2;
  std::vector<Scalar> output(half * half * channels);
  for (size_t y = 0; y < half; ++y) {
    for (size_t x = 0; x < half; ++x) {
      for (size_t c = 0; c < channels; ++c) {
        const auto at = [&](size_t dy, size_t dx) {
          return input[((2 * y + dy) * size + 2 * x + dx) * channels + c];
        };
        output[(y * half + x) * channels + c] =
            std::max(std::max(at(0, 0), at(0, 1)), std::max(at(1, 0), at(1, 1)));
      }
    }
  }
  return output;
}

// Output pixel i has its centre at (i + 0.5) / 2 - 0.5 of the input; outside its first and last
// centre the input repeats.
template <class Scalar>
std::vector<Scalar> upsample(const std::vector<Scalar>& input, const ValueShape& shape) {
  const int size = static_cast<int>(shape.size), channels = static_cast<int>(shape.channels),
            twice = 2 * size;
  const auto place = [&](int i, int& low, int& high, Scalar& part) {
    const Scalar centre = std::max(Scalar(0), (Scalar(i) + Scalar(0.5)) / 2 - Scalar(0.5));
    low = std::min(static_cast<int>(centre), size - 1);
    high = std::min(low + 1, size - 1);
    part = centre - Scalar(low);
  };
  std::vector<Scalar> output(size_t(twice) * twice * channels);
  for (int y = 0; y < twice; ++y) {
    for (int x = 0; x < twice; ++x) {
      int y0, y1, x0, x1;
      Scalar py, px;
      place(y, y0, y1, py);
      place(x, x0, x1, px);
      for (int c = 0; c < channels; ++c) {
        const auto at = [&](int row, int column) {
          return input[(size_t(row) * size + column) * channels + c];
        };
        const Scalar top = at(y0, x0) + px * (at(y0, x1) - at(y0, x0)),
                     bottom = at(y1, x0) + px * (at(y1, x1) - at(y1, x0));
        output[(size_t(y) * twice + x) * channels + c] = top + py * (bottom - top);
      }
    }
  }
  return output;
}

// All values, the input first.
template <class Scalar>
std::vector<std::vector<Scalar>> evaluate_reference(const Network& network,
                                                    const std::vector<ValueShape>& shapes,
                                                    std::vector<Scalar> input) {
  std::vector<std::vector<Scalar>> values{std::move(input)};
  for (const Layer& layer : network.layers) {
    const std::vector<Scalar>& a = values[layer.inputs[0]];
    const ValueShape& shape = shapes[layer.inputs[0]];
    switch (layer.op) {
      case LayerOp::kConv2d:
        values.push_back(convolve(layer, a, shape));
        break;
      case LayerOp::kMaxPool2:
        values.push_back(max_pool(a, shape));
        break;
      case LayerOp::kUpsample2:
        values.push_back(upsample(a, shape));
        break;
      case LayerOp::kConcat: {
        const std::vector<Scalar>& b = values[layer.inputs[1]];
        const size_t ca = shape.channels, cb = shapes[layer.inputs[1]].channels,
                     pixels = size_t(shape.size) * shape.size;
        std::vector<Scalar> joined;
        for (size_t p = 0; p < pixels; ++p) {
          joined.insert(joined.end(), a.begin() + p * ca, a.begin() + (p + 1) * ca);
          joined.insert(joined.end(), b.begin() + p * cb, b.begin() + (p + 1) * cb);
        }
        values.push_back(std::move(joined));
        break;
      }
    }
  }
  return values;
}

// The last value.
template <class Scalar>
std::vector<Scalar> run_reference(const Network& network, const std::vector<ValueShape>& shapes,
                                  std::vector<Scalar> input) {
  return evaluate_reference<Scalar>(network, shapes, std::move(input)).back();
}

}  // namespace figurine::tests
