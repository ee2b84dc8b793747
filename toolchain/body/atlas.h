// Where texels go: a surface's UV layout taken apart into charts, and laid out anew with a density
// of texels for each part of the body (docs/decisions/0029-atlas.md).
//
// A chart is a connected piece of the source layout. It is scaled evenly, turned and moved, never
// cut, mirrored or bent: seams, and what a chart's own map stretches, stay as they came.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "toolchain/body/surface.h"

namespace figurine::body {

// kBody: trunk, and whatever is mostly none of the others, a suit of trunk, arms and legs above
// all.
enum class BodyPart : uint8_t { kBody, kHead, kArms, kHands, kLegs, kFeet };
inline constexpr uint32_t kBodyPartCount = 6;

const char* to_string(BodyPart part);  // "body", "head", ...
std::optional<BodyPart> find_body_part(const std::string& name);

struct Chart {
  std::vector<uint32_t> triangles;  // ascending; none of them hidden
  BodyPart part = BodyPart::kBody;  // to which more than half of its surface belongs
  double surface_m2 = 0;            // on the body
  double uv_area = 0;               // in the layout, of the square
};

// The charts in the order of their first triangles. Triangles hang together where they share a
// texture coordinate.
std::vector<Chart> find_charts(const Surface& surface);

// [F] which of them each triangle is in; kNoChart: none, it is hidden.
std::vector<uint32_t> chart_of_triangles(const Surface& surface);
inline constexpr uint32_t kNoChart = 0xffffffffu;

struct AtlasOptions {
  // [parts] texels for each square metre, relative to one another; > 0. A chart has its part's.
  std::array<double, kBodyPartCount> weight{1, 1, 1, 1, 1, 1};
  // T of the bodies that are made of it, or more.
  uint32_t uv_size = 128;
  // Between the cells that two charts cover in a grid of so many cells a side
  // (figurine/texel_grid.h), and in every finer one, lie two others or more: the border rings end
  // before them. At most uv_size.
  uint32_t coarsest_grid = 64;
  uint32_t attempts = 4000;  // of the packing search
};

// The surface in a layout of these weights: other texture coordinates, of the same charts; hidden
// triangles keep theirs. The same on every machine. InputError for a weight that is not positive
// and finite, a weight other than 1 for a part that no chart is of, a chart without area, or if the
// charts do not fit.
Surface pack_atlas(const Surface& surface, const AtlasOptions& options);

}  // namespace figurine::body
