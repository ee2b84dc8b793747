// Whether a static part's values mean something at every texel of a body.
#include <algorithm>
#include <cmath>
#include <string>

#include "figurine/avatar.h"
#include "figurine/detail/memory_reserve.h"
#include "figurine/texel_grid.h"

namespace figurine {
namespace {

// The reason, or null. uv_size: T.
const char* shape_fault(const StaticGroup& group, uint32_t uv_size, uint32_t& taken) {
  if (group.channels < 1 || group.channels > kStaticChannels ||
      group.first_channel > kStaticChannels - group.channels) {
    return "its channels are none, or beyond the 14 that may be static";
  }
  const uint32_t mask = ((1u << group.channels) - 1) << group.first_channel;
  if ((taken & mask) != 0) return "another group has one of its channels";
  taken |= mask;
  if (!grid_fits(uv_size, group.grid_size))
    return "its grid does not have 1, 1/2, 1/4 or 1/8 of the texels a side";
  if (group.scale.size() != group.channels) return "not one scale for each channel";
  const uint64_t cells = group.values.size() / group.channels;
  if (cells == 0 || cells * group.channels != group.values.size() ||
      cells > uint64_t{group.grid_size} * group.grid_size) {
    return "its values are not one for each channel of each cell";
  }
  return nullptr;
}

const char* scale_fault(const StaticGroup& group) {
  for (uint32_t c = 0; c < group.channels; ++c) {
    const float bound =
        group.first_channel + c < kStaticColour ? kMaxStaticValue : kMaxStaticLogGain;
    const float scale = group.scale[c];
    if (!(scale > 0) || !std::isnormal(scale)) return "a scale is not positive and normal";
    if (!(scale * 127 <= bound)) return "a scale is too large";
  }
  return nullptr;
}

const char* value_fault(const StaticGroup& group) {
  if (std::ranges::find(group.values, int8_t{-128}) != group.values.end()) return "a value is -128";
  return scale_fault(group);
}

size_t covered_cells(const Body& body, uint32_t size) {
  std::vector<bool> covered(size_t{size} * size);
  const uint32_t step = body.uv_size / size;
  for (const uint32_t texel : body.texel)
    covered[size_t{texel / body.uv_size / step} * size + texel % body.uv_size / step] = true;
  return static_cast<size_t>(std::ranges::count(covered, true));
}

Status fault(size_t group, const std::string& what) {
  return Status(StatusCode::kCorrupt, "static part: group " + std::to_string(group) + ": " + what);
}

}  // namespace

Status validate_static_part(const StaticPart& part, uint32_t uv_size) {
  uint32_t taken = 0;  // bit c: channel c is in a group
  for (size_t g = 0; g < part.groups.size(); ++g) {
    if (const char* what = shape_fault(part.groups[g], uv_size, taken)) return fault(g, what);
    if (const char* what = value_fault(part.groups[g])) return fault(g, what);
  }
  return {};
}

Status validate_static_scales(const StaticPart& part) {
  for (size_t g = 0; g < part.groups.size(); ++g) {
    if (const char* what = scale_fault(part.groups[g])) return fault(g, what);
  }
  return {};
}

Status validate_static_part(const StaticPart& part, const Body& body) {
  FIG_RETURN_IF_ERROR(validate_static_part(part, body.uv_size));
  for (size_t g = 0; g < part.groups.size(); ++g) {
    const StaticGroup& group = part.groups[g];
    const MemoryReserve reserve(size_t{group.grid_size} * group.grid_size / 8);
    if (!reserve.held()) return no_memory();
    const size_t cells = group.values.size() / group.channels,
                 needed = covered_cells(body, group.grid_size);
    if (cells == needed) continue;
    return fault(g, "has values for " + std::to_string(cells) + " cells, the body covers " +
                        std::to_string(needed));
  }
  return {};
}

}  // namespace figurine
