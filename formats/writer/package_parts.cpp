#include "formats/writer/package_parts.h"

#include <limits>

#include "figurine/detail/rans.h"
#include "formats/src/package/layout.h"

namespace figurine {

namespace {

// Collects blobs and the first array whose length does not fit its shape.
class PartList {
 public:
  explicit PartList(std::vector<BlobPart>& blobs) : blobs_(blobs) {}

  // inner: the trailing lengths of the shape; the first one follows from the array. Empty arrays
  // make no blob.
  template <class T>
  void add(const std::string& name, std::span<const T> values,
           const std::vector<uint32_t>& inner = {}, size_t expected_first = 0) {
    if (values.empty() && expected_first == 0) return;
    uint64_t row = 1;
    for (uint32_t length : inner) row *= length;
    const uint64_t first = row == 0 ? 0 : values.size() / row;
    const bool fits =
        row != 0 && first * row == values.size() && first <= std::numeric_limits<uint32_t>::max();
    if (!fits || (expected_first != 0 && first != expected_first)) {
      if (status_.ok()) {
        status_ = Status(
            StatusCode::kInvalidArgument,
            name + ": has " + std::to_string(values.size()) + " values, rows of " +
                std::to_string(row) +
                (expected_first != 0 ? ", needs " + std::to_string(expected_first) + " rows" : ""));
      }
      return;
    }
    BlobPart part{.name = name,
                  .type = type_of(T{}),
                  .shape = {static_cast<uint32_t>(first)},
                  .bytes = std::as_bytes(values)};
    part.shape.insert(part.shape.end(), inner.begin(), inner.end());
    blobs_.push_back(std::move(part));
  }

  // As add, and a reader that does not know the name may skip it.
  template <class T>
  void add_optional(const std::string& name, std::span<const T> values,
                    const std::vector<uint32_t>& inner, size_t expected_first) {
    if (values.empty()) return;
    const size_t before = blobs_.size();
    add(name, values, inner, expected_first);
    if (blobs_.size() > before) blobs_.back().optional = true;
  }

  const Status& status() const { return status_; }

 private:
  static DataType type_of(float) { return DataType::kF32; }
  static DataType type_of(uint8_t) { return DataType::kU8; }
  static DataType type_of(int8_t) { return DataType::kI8; }
  static DataType type_of(int16_t) { return DataType::kI16; }
  static DataType type_of(int32_t) { return DataType::kI32; }
  static DataType type_of(uint32_t) { return DataType::kU32; }
  static DataType type_of(Half) { return DataType::kF16; }

  std::vector<BlobPart>& blobs_;
  Status status_;
};

void add_float_weights(const std::string& prefix, const Network& network,
                       const std::vector<ValueShape>& shapes, PartList& list) {
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const std::string name = prefix + "." + std::to_string(i);
    list.add(name + ".weights", layer.weights,
             {layer.kernel, layer.kernel, shapes[layer.inputs[0]].channels}, layer.out_channels);
    list.add(name + ".bias", layer.bias, {}, layer.out_channels);
  }
}

void add_fixed_point(const Network& network, const FixedPointNetwork& fixed,
                     const std::vector<ValueShape>& shapes, PartList& list) {
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const FixedPointConvolution& convolution = fixed.convolutions[i];
    const std::string name = "fixed." + std::to_string(i);
    list.add(name + ".weights", convolution.weights,
             {layer.kernel, layer.kernel, shapes[layer.inputs[0]].channels}, layer.out_channels);
    list.add(name + ".scale", convolution.weight_scale, {}, layer.out_channels);
    list.add(name + ".bias", convolution.bias, {}, layer.out_channels);
  }
}

void add_static_part(const StaticPart& part, PartList& list) {
  for (size_t g = 0; g < part.groups.size(); ++g) {
    const StaticGroup& group = part.groups[g];
    const std::string name = "static." + std::to_string(g);
    list.add(name + ".values", group.values, {group.channels});
    list.add(name + ".scale", group.scale, {}, group.channels);
  }
}

// kInvalidArgument if the network's weights do not have its shapes. None makes no blobs.
Status add_network(const Avatar& avatar, PackageParts& parts, PartList& list) {
  if (!avatar.has_network()) return {};
  // The list's shapes say how the weights are laid out; their number is checked against them here,
  // their values by the reader.
  const bool has_floats = avatar.holds(Precision::kFloat32) || avatar.fixed_point.empty();
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, has_floats);
  if (!shapes.ok()) return Status(StatusCode::kInvalidArgument, shapes.status().message());
  if (has_floats) add_float_weights("network", avatar.network, *shapes, list);
  if (avatar.fixed_point.empty()) return {};
  if (avatar.fixed_point.convolutions.size() != avatar.network.layers.size())
    return Status(StatusCode::kInvalidArgument, "avatar.fixed_point: not one entry per layer");
  parts.required_features |= kFeatureFixedPoint;
  add_fixed_point(avatar.network, avatar.fixed_point, *shapes, list);
  return {};
}

// Of all of a sampler's avatars, in floats and in fixed point.
Status add_shared_network(const Sampler& sampler, PackageParts& parts, PartList& list) {
  if (!sampler.shares_network) return {};
  const Result<std::vector<ValueShape>> shapes = infer_shapes(sampler.network, true);
  if (!shapes.ok()) return Status(StatusCode::kInvalidArgument, shapes.status().message());
  if (sampler.fixed_point.convolutions.size() != sampler.network.layers.size())
    return Status(StatusCode::kInvalidArgument, "sampler.fixed_point: not one entry per layer");
  parts.required_features |= kFeatureFixedPoint;
  add_float_weights("network", sampler.network, *shapes, list);
  add_fixed_point(sampler.network, sampler.fixed_point, *shapes, list);
  return {};
}

void add_pose_statistics(const PoseStatistics& statistics, PackageParts& parts, PartList& list) {
  const size_t features = statistics.joints.size() * 3;
  if (features == 0) return;
  list.add("pose.mean", statistics.mean, {}, features);
  list.add("pose.covariance", statistics.covariance, {static_cast<uint32_t>(features)}, features);
  if (statistics.distances.empty()) return;
  parts.optional_features |= kOptionalPoseDistances;
  list.add_optional("pose.distances", statistics.distances, {}, statistics.distances.size());
}

}  // namespace

Result<PackageParts> take_apart(const Body& body, const Provenance& provenance) {
  PackageParts parts{.kind = PackageKind::kBody, .content = &body, .provenance = provenance};
  parts.budget.gaussians = body.texel_count();
  const uint32_t joints = body.joint_count(), texels = body.texel_count();
  PartList list(parts.blobs);
  list.add("body.parents", body.parents, {}, body.joint_names.size());
  list.add("body.joint_position", body.joint_position_m, {3}, joints);
  list.add("body.joint_shape_basis", body.joint_shape_basis_m, {joints, 3});
  list.add("body.texel", body.texel);
  list.add("body.texel_position", body.texel_position_m, {3}, texels);
  list.add("body.texel_normal", body.texel_normal, {3}, texels);
  list.add("body.texel_joints", body.texel_joints, {kSkinInfluences}, texels);
  list.add("body.texel_weights", body.texel_weights, {kSkinInfluences}, texels);
  list.add("body.texel_spacing", body.texel_spacing_m, {}, texels);
  list.add("body.texel_shape_basis", body.texel_shape_basis_m, {texels, 3});
  list.add("body.border_texel", body.border_texel);
  list.add("body.border_source", body.border_source, {}, body.border_texel.size());
  list.add_optional("body.texel_triangle", body.texel_triangle, {}, texels);
  list.add_optional("body.texel_barycentric", body.texel_barycentric, {3}, texels);
  if (!list.status().ok()) return list.status();
  return parts;
}

Result<PackageParts> take_apart(const Avatar& avatar, const Budget& budget,
                                const Provenance& provenance) {
  PackageParts parts{
      .kind = PackageKind::kAvatar, .content = &avatar, .budget = budget, .provenance = provenance};
  PartList list(parts.blobs);
  list.add("avatar.shape", avatar.shape);
  FIG_RETURN_IF_ERROR(add_network(avatar, parts, list));
  add_static_part(avatar.static_part, list);
  list.add("filter.smallest_extent", avatar.smallest_extents.codes);
  if (layout::needs_static_feature(avatar)) parts.required_features |= kFeatureStaticPart;
  if (layout::needs_filter_feature(avatar)) parts.required_features |= kFeatureFilters;
  if (avatar.decoding.max_offset != 0) parts.required_features |= kFeatureBoundedOffsets;
  add_pose_statistics(avatar.pose_statistics, parts, list);
  list.add("golden.rotations", avatar.golden.rotations, {4});
  list.add("golden.png", avatar.golden.png);
  if (!list.status().ok()) return list.status();
  if (avatar.golden.rotations.empty() && !avatar.golden.png.empty()) {
    return Status(StatusCode::kInvalidArgument, "golden.png: there is no golden pose for it");
  }
  return parts;
}

Result<PackageParts> take_apart(const Motion& motion, const Provenance& provenance) {
  PackageParts parts{.kind = PackageKind::kMotion, .content = &motion, .provenance = provenance};
  PartList list(parts.blobs);
  list.add("motion.root_translation", motion.root_translation_m, {3}, motion.frame_count);
  list.add("motion.rotations", motion.rotations,
           {static_cast<uint32_t>(motion.joint_names.size()), 4}, motion.frame_count);
  if (!list.status().ok()) return list.status();
  return parts;
}

Result<PackageParts> take_apart(const Population& population, const Budget& budget,
                                const Provenance& provenance, std::span<const Provenance> own) {
  const Population& p = population;
  PackageParts parts{.kind = PackageKind::kPopulation,
                     .content = &p,
                     .budget = budget,
                     .provenance = provenance,
                     .member_provenance = own};
  const Result<std::vector<ValueShape>> shapes = infer_shapes(p.network, true);
  if (!shapes.ok()) return Status(StatusCode::kInvalidArgument, shapes.status().message());
  if (p.members.empty() || own.size() != p.size())
    return Status(StatusCode::kInvalidArgument,
                  "population.members: none, or not one provenance each");
  uint32_t weights = 0, rows = 0, convolutions = 0;
  for (const Layer& layer : p.network.layers) {
    weights += static_cast<uint32_t>(layer.weights.size());
    rows += static_cast<uint32_t>(layer.bias.size());
    convolutions += layer.op == LayerOp::kConv2d;
  }
  for (const PopulationMember& member : p.members) {
    if (member.decoding.max_offset != 0) parts.required_features |= kFeatureBoundedOffsets;
  }
  PartList list(parts.blobs);
  add_float_weights("initial", p.network, *shapes, list);
  const auto members = p.size();
  const auto row_of = [&](const auto& array) {
    return static_cast<uint32_t>(array.size() / members);
  };
  if (!p.shape.empty()) list.add("population.shape", p.shape, {row_of(p.shape)}, members);
  if (p.coding != DifferenceCoding::kNone) list.add("population.bias", p.bias, {rows}, members);
  if (p.coding == DifferenceCoding::kInt8) {
    list.add("population.scale", p.scale, {rows}, members);
    list.add("population.frequency", p.frequency, {uint32_t{kRansValues}}, convolutions);
    list.add("population.code", p.code);
    list.add("population.code_end", p.code_end, {}, members);
  } else if (p.coding == DifferenceCoding::kHalf) {
    list.add("population.difference", p.difference, {weights}, members);
  }
  if (!p.static_part.empty()) {
    const uint32_t channels = row_of(p.static_scale);
    add_static_part(p.static_part, list);
    list.add("population.static_scale", p.static_scale, {channels}, members);
    list.add("population.static_frequency", p.static_frequency, {uint32_t{kRansValues}}, channels);
    list.add("population.static_code", p.static_code);
    list.add("population.static_code_end", p.static_code_end, {}, members);
  }
  if (layout::needs_static_feature(p)) parts.required_features |= kFeatureStaticPart;
  if (layout::needs_filter_feature(p)) parts.required_features |= kFeatureFilters;
  if (const auto features = static_cast<uint32_t>(3 * p.pose_joints.size()); features != 0) {
    list.add("pose.mean", p.pose_mean, {features}, members);
    list.add("pose.factor", p.pose_factor, {features * (features + 1) / 2}, members);
  }
  if (!p.golden_poses.empty())
    list.add("golden.rotations", p.golden_poses, {row_of(p.golden_poses) / 4, 4}, members);
  if (!list.status().ok()) return list.status();
  return parts;
}

Result<PackageParts> take_apart(const Sampler& sampler, const Budget& budget,
                                const Provenance& provenance) {
  PackageParts parts{.kind = PackageKind::kSampler,
                     .content = &sampler,
                     .budget = budget,
                     .provenance = provenance};
  const Result<std::vector<ValueShape>> shapes = infer_shapes(sampler.network, false);
  if (!shapes.ok()) return Status(StatusCode::kInvalidArgument, shapes.status().message());
  const std::vector<size_t> tokens = sampler_token_sizes(sampler);
  if (sampler.ranks.size() != tokens.size()) {
    return Status(StatusCode::kInvalidArgument,
                  "sampler.ranks: has " + std::to_string(sampler.ranks.size()) + " entries for " +
                      std::to_string(tokens.size()) + " tokens");
  }
  if (sampler.denoiser.blocks > kMaxDenoiserBlocks) {
    return Status(StatusCode::kInvalidArgument,
                  "sampler.denoiser.blocks: is above " + std::to_string(kMaxDenoiserBlocks));
  }
  size_t values = 0, directions = 0, direction_bytes = 0, rows = 0, matrix_bytes = 0;
  for (size_t token = 0; token < tokens.size(); ++token) {
    values += tokens[token];
    directions += sampler.ranks[token];
    direction_bytes += sampler.ranks[token] * tokens[token];
  }
  for (const MatrixShape& matrix : denoiser_matrices(sampler.denoiser, sampler.ranks)) {
    rows += matrix.rows;
    matrix_bytes += size_t{matrix.rows} * matrix.columns;
  }
  if (sampler.decoding.max_offset != 0) parts.required_features |= kFeatureBoundedOffsets;
  if (layout::needs_static_feature(sampler)) parts.required_features |= kFeatureStaticPart;
  if (layout::needs_filter_feature(sampler)) parts.required_features |= kFeatureFilters;
  const uint32_t d = sampler.denoiser.d_model;
  PartList list(parts.blobs);
  list.add("space.mean", sampler.mean, {}, values);
  list.add("space.directions", sampler.directions, {}, direction_bytes);
  list.add("space.direction_scale", sampler.direction_scale, {}, directions);
  list.add("denoiser.matrices", sampler.matrices, {}, matrix_bytes);
  list.add("denoiser.row_scale", sampler.row_scale, {}, rows);
  list.add("denoiser.bias", sampler.bias, {}, rows);
  list.add("denoiser.position", sampler.position, {d}, tokens.size() + 1);
  list.add("denoiser.norm", sampler.norm, {2, d}, size_t{2} * sampler.denoiser.blocks + 1);
  add_pose_statistics(sampler.pose_statistics, parts, list);
  list.add("golden.rotations", sampler.golden.rotations, {4});
  FIG_RETURN_IF_ERROR(add_shared_network(sampler, parts, list));
  for (size_t g = 0; g < sampler.static_groups.size(); ++g) {
    const std::string name = "static." + std::to_string(g);
    list.add(name + ".scale", sampler.static_groups[g].scale);
    list.add(name + ".row", sampler.static_groups[g].row);
  }
  list.add("sampler.report", std::span(reinterpret_cast<const uint8_t*>(sampler.report.data()),
                                       sampler.report.size()));
  if (!list.status().ok()) return list.status();
  return parts;
}

}  // namespace figurine
