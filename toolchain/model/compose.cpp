#include "toolchain/model/compose.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"
#include "figurine/gaussian.h"
#include "figurine/network.h"
#include "toolchain/model/parallel.h"

namespace figurine::model {

namespace {

constexpr uint32_t kChunk = 256;  // texels or cells per task
constexpr uint32_t kColours = kStaticChannels - kStaticColour;

template <class Body>
void for_each(uint32_t threads, uint32_t count, const Body& body) {
  parallel_for(threads, (count + kChunk - 1) / kChunk, [&](uint32_t chunk) {
    for (uint32_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) body(i);
  });
}

// values: rows of `stride`, row_of(r) the address of a tap's. In the order of the definition.
template <class Scalar, class RowOf>
void interpolate(const GridTaps& taps, const RowOf& row_of, uint32_t count, Scalar* out) {
  const Scalar w0 = Scalar(taps.weight[0]), w1 = Scalar(taps.weight[1]),
               w2 = Scalar(taps.weight[2]), w3 = Scalar(taps.weight[3]);
  const Scalar *x0 = row_of(taps.row[0]), *x1 = row_of(taps.row[1]), *x2 = row_of(taps.row[2]),
               *x3 = row_of(taps.row[3]);
  for (uint32_t c = 0; c < count; ++c)
    out[c] = (w0 * x0[c] + w1 * x1[c]) + (w2 * x2[c] + w3 * x3[c]);
}

// One row of a grid's values at a texel.
template <class Scalar, class RowOf>
void value_at(const GridInterpolation& grid, uint32_t texel, const RowOf& row_of, uint32_t count,
              Scalar* out) {
  if (grid.identity) {
    std::copy_n(row_of(texel), count, out);
  } else {
    interpolate(grid.taps[texel], row_of, count, out);
  }
}

// The transpose of value_at: rows [N,stride], of which `count` values from `first` on, to a cell's.
template <class Scalar>
void gather(const GridInterpolation& grid, uint32_t cell, const Scalar* rows, uint32_t stride,
            uint32_t count, Scalar* out) {
  if (grid.identity) {
    std::copy_n(rows + size_t(cell) * stride, count, out);
    return;
  }
  std::fill_n(out, count, Scalar(0));
  for (uint32_t k = grid.first_share[cell]; k < grid.first_share[cell + 1]; ++k) {
    const Scalar weight = Scalar(grid.shares[k].weight);
    const Scalar* row = rows + size_t(grid.shares[k].texel) * stride;
    for (uint32_t c = 0; c < count; ++c) out[c] += weight * row[c];
  }
}

template <class Scalar>
bool all_zero(const Scalar* values, uint32_t count) {
  return std::all_of(values, values + count, [](Scalar value) { return value == 0; });
}

}  // namespace

GridInterpolation GridInterpolation::of(const Body& body, uint32_t size) {
  GridInterpolation grid;
  TexelGrid cells = make_texel_grid(body, size);
  grid.cell = std::move(cells.cell);
  grid.identity = size == body.uv_size;
  if (grid.identity) return grid;
  cells.cell = grid.cell;
  grid.taps = make_grid_taps(body, cells);
  grid.first_share.assign(grid.cell.size() + 1, 0);
  const auto for_each_tap = [&](const auto& visit) {
    for (uint32_t i = 0; i < grid.taps.size(); ++i) {
      for (int k = 0; k < 4; ++k) {
        if (grid.taps[i].weight[k] != 0) visit(i, grid.taps[i].row[k], grid.taps[i].weight[k]);
      }
    }
  };
  for_each_tap([&](uint32_t, uint32_t cell, float) { ++grid.first_share[cell + 1]; });
  for (size_t m = 1; m < grid.first_share.size(); ++m)
    grid.first_share[m] += grid.first_share[m - 1];
  grid.shares.resize(grid.first_share.back());
  std::vector<uint32_t> next(grid.first_share.begin(), grid.first_share.end() - 1);
  for_each_tap([&](uint32_t texel, uint32_t cell, float weight) {
    grid.shares[next[cell]++] = {texel, weight};
  });
  return grid;
}

HeadComposer::HeadComposer(const Body& body, const HeadLayout& layout)
    : layout_(layout), texels_(body.texel_count()), static_begin_{0} {
  FIG_CHECK(layout.channels >= kStaticChannels, "channels of a head");
  if (layout.network_size > 0) network_ = GridInterpolation::of(body, layout.network_size);
  for (const StaticChannels& group : layout.statics) {
    FIG_CHECK(group.count > 0 && group.first + group.count <= kStaticChannels, "static channels");
    for (uint32_t c = group.first; c < group.first + group.count; ++c) {
      FIG_CHECK(!covered_[c], "a static channel in two groups");
      covered_[c] = true;
    }
    statics_.push_back(GridInterpolation::of(body, group.grid_size));
    static_begin_.push_back(static_begin_.back() + statics_.back().cell.size() * group.count);
  }
}

bool HeadComposer::gains(uint32_t channel) const {
  return layout_.colour == StaticColour::kGain && channel >= kStaticColour && covered_[channel];
}

bool HeadComposer::has_gains() const {
  for (uint32_t c = kStaticColour; c < kStaticChannels; ++c) {
    if (gains(c)) return true;
  }
  return false;
}

template <class Scalar>
void HeadComposer::static_values(const Scalar* statics, uint32_t texel, Scalar* values) const {
  for (size_t g = 0; g < statics_.size(); ++g) {
    const uint32_t count = layout_.statics[g].count;
    const Scalar* group = statics + static_begin_[g];
    value_at(
        statics_[g], texel, [&](uint32_t row) { return group + size_t(row) * count; }, count,
        values + layout_.statics[g].first);
  }
}

template <class Scalar>
void HeadComposer::forward(const Scalar* network, const Scalar* statics, uint32_t threads,
                           Scalar* head) const {
  const uint32_t channels = layout_.channels;
  for_each(threads, texels_, [&](uint32_t i) {
    Scalar* const h = head + size_t(i) * channels;
    if (layout_.network_size > 0) {
      const auto row = [&](uint32_t m) { return network + size_t(network_.cell[m]) * channels; };
      value_at(network_, i, row, channels, h);
    } else {
      std::fill_n(h, channels, Scalar(0));
    }
    if (statics_.empty()) return;
    Scalar s[kStaticChannels];
    static_values(statics, i, s);
    for (uint32_t c = 0; c < kStaticChannels; ++c) {
      if (!covered_[c]) continue;
      if (!gains(c)) {
        h[c] += s[c];
        continue;
      }
      const Scalar gain = std::exp(s[c]);
      h[c] = (h[c] + Scalar(kHalfColour)) * gain - Scalar(kHalfColour);
      for (uint32_t k = c + kColours; k < channels; k += kColours) h[k] *= gain;
    }
  });
}

// head_gradient: [C] dL/dhead comes in, dL/d of the network's output at the texel goes out.
// static_gradient: [kStaticChannels] dL/d of the static values there.
template <class Scalar>
void HeadComposer::differentiate_texel(const Scalar* network, const Scalar* statics, uint32_t texel,
                                       Scalar* head_gradient, Scalar* static_gradient) const {
  const uint32_t channels = layout_.channels;
  std::copy_n(head_gradient, kStaticChannels, static_gradient);
  if (!has_gains() || all_zero(head_gradient, channels)) return;
  Scalar s[kStaticChannels], h[head_channels(kMaxShDegree)] = {};
  static_values(statics, texel, s);
  if (layout_.network_size > 0) {
    const auto row = [&](uint32_t m) {
      return network + size_t(network_.cell[m]) * channels + kStaticColour;
    };
    value_at(network_, texel, row, channels - kStaticColour, h + kStaticColour);
  }
  for (uint32_t c = kStaticColour; c < kStaticChannels; ++c) {
    if (!gains(c)) continue;
    const Scalar gain = std::exp(s[c]);
    Scalar along = head_gradient[c] * (h[c] + Scalar(kHalfColour));
    head_gradient[c] *= gain;
    for (uint32_t k = c + kColours; k < channels; k += kColours) {
      along += head_gradient[k] * h[k];
      head_gradient[k] *= gain;
    }
    static_gradient[c] = along * gain;
  }
}

template <class Scalar>
void HeadComposer::backward(const Scalar* network, const Scalar* statics,
                            const Scalar* head_gradient, uint32_t threads, Scalar* network_gradient,
                            Scalar* static_gradient) const {
  const uint32_t channels = layout_.channels;
  std::vector<Scalar> at_network, at_statics;  // [N,C], [N,kStaticChannels]
  if (!statics_.empty()) {
    at_network.assign(head_gradient, head_gradient + size_t(texels_) * channels);
    at_statics.resize(size_t(texels_) * kStaticChannels);
    for_each(threads, texels_, [&](uint32_t i) {
      differentiate_texel(network, statics, i, &at_network[size_t(i) * channels],
                          &at_statics[size_t(i) * kStaticChannels]);
    });
    head_gradient = at_network.data();
  }
  for (size_t g = 0; g < statics_.size(); ++g) {
    const StaticChannels& group = layout_.statics[g];
    for_each(threads, static_cells(g), [&](uint32_t m) {
      gather(statics_[g], m, at_statics.data() + group.first, kStaticChannels, group.count,
             static_gradient + static_begin_[g] + size_t(m) * group.count);
    });
  }
  if (layout_.network_size == 0) return;
  std::fill_n(network_gradient, size_t(layout_.network_size) * layout_.network_size * channels,
              Scalar(0));
  for_each(threads, static_cast<uint32_t>(network_.cell.size()), [&](uint32_t m) {
    gather(network_, m, head_gradient, channels, channels,
           network_gradient + size_t(network_.cell[m]) * channels);
  });
}

template void HeadComposer::forward(const float*, const float*, uint32_t, float*) const;
template void HeadComposer::forward(const double*, const double*, uint32_t, double*) const;
template void HeadComposer::backward(const float*, const float*, const float*, uint32_t, float*,
                                     float*) const;
template void HeadComposer::backward(const double*, const double*, const double*, uint32_t, double*,
                                     double*) const;

}  // namespace figurine::model
