// From the network's output and the static values to the head of every texel, and the analytic
// gradient back (StaticPart in figurine/avatar.h; docs/numerics.md, "Grids").
//
// Both may lie on grids coarser than the texels and are interpolated there. Backward, every cell
// gathers from its texels in their order, so results do not depend on the number of threads. A
// network at the texels' own resolution and no static values is a copy, without arithmetic.
// Instantiated for float (training) and double (finite-difference checks).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/texel_grid.h"

namespace figurine::model {

// How static colours meet the network's: times e^s, which is what packages hold, or as a sum like
// all other channels, for comparison.
enum class StaticColour : uint8_t { kGain, kSum };

// Neighbouring static channels on one grid.
struct StaticChannels {
  uint32_t first = 0, count = 0;  // within kStaticChannels
  uint32_t grid_size = 0;         // cells a side
};

struct HeadLayout {
  uint32_t network_size = 0;  // T_n; 0: no network, which then counts as zeros
  uint32_t channels = 0;      // of the head
  std::vector<StaticChannels> statics;
  StaticColour colour = StaticColour::kGain;
};

// A grid's taps both ways.
struct GridInterpolation {
  struct Share {
    uint32_t texel;
    float weight;
  };

  bool identity = false;              // a cell a texel: everything below but `cell` is empty
  std::vector<uint32_t> cell;         // [M] v * G + u
  std::vector<GridTaps> taps;         // [N]
  std::vector<uint32_t> first_share;  // [M + 1] where a cell's stretch of `shares` begins
  std::vector<Share> shares;          // of every cell, texels ascending

  static GridInterpolation of(const Body& body, uint32_t size);
};

class HeadComposer {
 public:
  // body is not kept. FIG_CHECKs that the grids fit and that no channel is in two groups.
  HeadComposer(const Body& body, const HeadLayout& layout);

  const HeadLayout& layout() const { return layout_; }
  uint32_t texel_count() const { return texels_; }
  // Static values lie group by group, each [M,channels of the group].
  size_t static_count() const { return static_begin_.back(); }
  size_t static_begin(size_t group) const { return static_begin_[group]; }
  uint32_t static_cells(size_t group) const {
    return static_cast<uint32_t>(statics_[group].cell.size());
  }

  // network: [T_n,T_n,C], null where there is none. statics: [static_count()]. head: [N,C].
  template <class Scalar>
  void forward(const Scalar* network, const Scalar* statics, uint32_t threads, Scalar* head) const;

  // head_gradient: [N,C] dL/dhead. network_gradient [T_n,T_n,C] (null where there is none) and
  // static_gradient [static_count()] are written whole. Texels of gradient zero pass none on, also
  // where their values are not finite.
  template <class Scalar>
  void backward(const Scalar* network, const Scalar* statics, const Scalar* head_gradient,
                uint32_t threads, Scalar* network_gradient, Scalar* static_gradient) const;

 private:
  bool gains(uint32_t channel) const;
  bool has_gains() const;
  template <class Scalar>
  void static_values(const Scalar* statics, uint32_t texel, Scalar* values) const;
  template <class Scalar>
  void differentiate_texel(const Scalar* network, const Scalar* statics, uint32_t texel,
                           Scalar* head_gradient, Scalar* static_gradient) const;

  HeadLayout layout_;
  uint32_t texels_ = 0;
  GridInterpolation network_;
  std::vector<GridInterpolation> statics_;  // [groups]
  std::vector<size_t> static_begin_;        // [groups + 1]
  bool covered_[kStaticChannels] = {};      // channels in some group
};

}  // namespace figurine::model
