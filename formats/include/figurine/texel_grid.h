// Coarser grids over a body's texels: a network that runs at half the side, and static values that
// are stored at their own resolution, reach the texels from here (docs/numerics.md, "Grids").
//
// Letters: T texels a side, N covered texels; G cells a side of the grid, M covered cells.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/body.h"

namespace figurine {

inline constexpr uint32_t kMaxGridStep = 8;  // T / G

// A square grid of G x G cells over the map of T x T texels, T / G = 1, 2, 4 or 8 texels a cell and
// side. A cell is covered where one of its texels is.
struct TexelGrid {
  uint32_t size = 0;                  // G
  std::vector<uint32_t> cell;         // [M] v * G + u, strictly ascending
  std::vector<uint32_t> source;       // [M] row in [0,N) of the texel that the cell stands for: the
                                      // covered one nearest to its centre, of equals the first
  std::vector<uint32_t> border_cell;  // [B] ascending; the two rings around the covered cells
  std::vector<uint32_t> border_source;  // [B] row in [0,M) of the nearest covered cell, of equals
                                        // the first; for G = T the body's own

  uint32_t cell_count() const { return static_cast<uint32_t>(cell.size()); }
};

// Whether a grid of `size` cells can lie over the body's texels.
bool grid_fits(uint32_t uv_size, uint32_t size);

// size must fit (FIG_CHECK).
TexelGrid make_texel_grid(const Body& body, uint32_t size);

// Where a texel's value lies among a grid's cells: bilinear, with half-pixel centres, in the order
// (v, u), (v, u + 1), (v + 1, u), (v + 1, u + 1).
//
//   value = (w0 x[r0] + w1 x[r1]) + (w2 x[r2] + w3 x[r3])
//
// Never across charts: cells that are not covered, or stand for a texel of another chart, have
// weight 0 and the others' are divided by their sum. Charts are the connected parts of the covered
// texels, corners included. A texel whose own cell stands for another chart and that has no other
// tap takes its own cell. With G = T the texel itself with weight 1, and the three others 0: then
// x[r0] is the value, without arithmetic.
struct GridTaps {
  uint32_t row[4];  // in [0,M); a tap of weight 0 names the texel's own cell
  float weight[4];  // >= 0, sum 1 within rounding
};

// [N] taps of every covered texel.
std::vector<GridTaps> make_grid_taps(const Body& body, const TexelGrid& grid);

}  // namespace figurine
