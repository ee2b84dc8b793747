#include "toolchain/train/grid_body.h"

#include <utility>

#include "figurine/texel_grid.h"

namespace figurine::train {

namespace {

template <class Value>
std::vector<Value> gather(std::span<const Value> rows, size_t width,
                          const std::vector<uint32_t>& source) {
  std::vector<Value> values;
  values.reserve(source.size() * width);
  for (const uint32_t row : source) {
    const Value* from = &rows[row * width];
    values.insert(values.end(), from, from + width);
  }
  return values;
}

}  // namespace

GridBody::GridBody(const Body& body, uint32_t size) : view_(body) {
  if (size == body.uv_size) return;
  TexelGrid grid = make_texel_grid(body, size);
  position_m_ = gather(body.texel_position_m, 3, grid.source);
  normal_ = gather(body.texel_normal, 3, grid.source);
  joints_ = gather(body.texel_joints, kSkinInfluences, grid.source);
  weights_ = gather(body.texel_weights, kSkinInfluences, grid.source);
  spacing_m_ = gather(body.texel_spacing_m, 1, grid.source);
  texel_ = std::move(grid.cell);
  border_texel_ = std::move(grid.border_cell);
  border_source_ = std::move(grid.border_source);
  view_.uv_size = size;
  view_.texel = texel_;
  view_.texel_position_m = position_m_;
  view_.texel_normal = normal_;
  view_.texel_joints = joints_;
  view_.texel_weights = weights_;
  view_.texel_spacing_m = spacing_m_;
  view_.texel_shape_basis_m = {};
  view_.border_texel = border_texel_;
  view_.border_source = border_source_;
}

}  // namespace figurine::train
