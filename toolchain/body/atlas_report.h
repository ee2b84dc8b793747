// What a layout is like: texels, their spacing and their stretch by part of the body, and how far
// charts lie apart on the grids that networks run on.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/body/atlas.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body {

struct PartFigures {
  BodyPart part = BodyPart::kBody;
  uint32_t charts = 0;
  double surface_m2 = 0;
  size_t texels = 0;
  double share_of_square = 0;  // texels of all T x T
  double density = 0;  // texels for each square metre, relative to kBody's if there is one, and
                       // to the whole's if not
  double spacing_median_mm = 0, spacing_p90_mm = 0;  // TexelBody::spacing_m
  double stretch_median = 0, stretch_p95 = 0;  // longest by shortest way on the surface of one
                                               // texel step, over its directions; 1: even
};

// A grid over the texels (figurine/texel_grid.h): a network may run on it, values be stored on it.
struct GridFigures {
  uint32_t size = 0;       // cells a side
  uint32_t gap_cells = 0;  // between the cells of two charts, at least; up to kMostGapCells are
                           // looked for
  size_t texels_beside_other_charts = 0;    // one of whose four cells stands for another chart
  size_t texels_in_other_charts_cells = 0;  // whose own cell does
};
inline constexpr uint32_t kMostGapCells = 8;

struct AtlasFigures {
  std::vector<PartFigures> parts;  // those that have a chart, in the order of BodyPart
  PartFigures whole;
  std::vector<GridFigures> grids;  // of T, T/2 and T/4, as far as they are whole and not below 8
  std::vector<uint32_t> charts_without_texels;  // in the order of find_charts
};

// texels: make_texel_body of a model with this surface.
AtlasFigures measure_atlas(const Surface& surface, const TexelBody& texels);

}  // namespace figurine::body
