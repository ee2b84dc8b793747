// The meaning of an avatar package: a network whose shapes fit its weights and its head, a static
// part whose grids fit the map, filters that have an arithmetic, parameters that decode to sound
// Gaussians, a pose distribution that can be inverted, a golden frame that can be drawn.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "figurine/detail/memory_reserve.h"
#include "figurine/gaussian.h"
#include "figurine/known_poses.h"
#include "figurine/texel_grid.h"
#include "formats/src/package/content.h"

namespace figurine {

Status read_map_statistics(const schema::MapStatistics& table, std::string_view owner,
                           MapStatistics& out) {
  const std::string field = concatenate({owner, ".map_statistics"});
  for (uint32_t c = 0; c < kMapChannels; ++c) {
    out.mean[c] = table.mean()->Get(c);
    out.scale[c] = table.scale()->Get(c);
    if (!(std::fabs(out.mean[c]) <= layout::kMaxLengthM))
      return corrupt(field, "channel ", c, ": the mean is not finite or too large");
    if (!(out.scale[c] > 0 && out.scale[c] <= 1e6f))
      return corrupt(field, "channel ", c, ": the scale is not positive, or too large");
  }
  return {};
}

Status read_decoding(const schema::HeadDecoding& table, std::string_view owner, HeadDecoding& out) {
  out = {.offset_scale_m = table.offset_scale_m(),
         .spacing_scale = table.spacing_scale(),
         .max_log_scale = table.max_log_scale(),
         .opacity_bias = table.opacity_bias(),
         .sh_degree = table.sh_degree(),
         .max_offset = table.max_offset()};
  const auto within = [](float value, float max) { return value > 0 && value <= max; };
  const std::string field = concatenate({owner, ".decoding."});
  if (!within(out.offset_scale_m, 10))
    return corrupt(field + "offset_scale_m", "is not above 0 and at most 10");
  if (!within(out.spacing_scale, 100))
    return corrupt(field + "spacing_scale", "is not above 0 and at most 100");
  if (!within(out.max_log_scale, 20))
    return corrupt(field + "max_log_scale", "is not above 0 and at most 20");
  if (!(std::fabs(out.opacity_bias) <= 100))
    return corrupt(field + "opacity_bias", "is not within -100 and 100");
  if (out.max_offset != 0 && !within(out.max_offset, 1000))
    return corrupt(field + "max_offset", "is neither 0 nor above it and at most 1000");
  if (out.sh_degree > kMaxShDegree) return corrupt(field + "sh_degree", "is above ", kMaxShDegree);
  return {};
}

// Shapes first, from the layer list alone: they say how large each weight blob has to be.
Status read_layers(const schema::Network& table, NoNetwork none, Network& out) {
  out.input_size = table.input_size();
  out.input_channels = table.input_channels();
  if (none == NoNetwork::kAllowed && table.layers()->size() == 0) {
    return out.input_size == 0 && out.input_channels == 0
               ? Status()
               : corrupt("network", "has an input, and no layers");
  }
  if (table.layers()->size() > kMaxLayers)
    return over_limit("network", "more than ", kMaxLayers, " layers");
  for (const schema::Layer* entry : *table.layers()) {
    out.layers.push_back({.op = static_cast<LayerOp>(entry->op()),
                          .inputs = {entry->input_a(), entry->input_b()},
                          .out_channels = entry->out_channels(),
                          .kernel = entry->kernel(),
                          .relu = entry->relu()});
  }
  return infer_shapes(out, false).status();
}

Status read_convolutions(BlobReader& blobs, std::string_view prefix, BlobReader::Presence presence,
                         Network& out) {
  const std::vector<ValueShape> shapes = *infer_shapes(out, false);
  for (size_t i = 0; i < out.layers.size(); ++i) {
    Layer& layer = out.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const std::string name = concatenate({prefix, ".", i});
    const uint32_t in_channels = shapes[layer.inputs[0]].channels;
    FIG_RETURN_IF_ERROR(blobs.read(name + ".weights",
                                   {layer.out_channels, layer.kernel, layer.kernel, in_channels},
                                   layer.weights, presence));
    FIG_RETURN_IF_ERROR(blobs.read(name + ".bias", {layer.out_channels}, layer.bias, presence));
    FIG_RETURN_IF_ERROR(
        check_magnitude(layer.weights, name + ".weights", std::numeric_limits<float>::max()));
    FIG_RETURN_IF_ERROR(
        check_magnitude(layer.bias, name + ".bias", std::numeric_limits<float>::max()));
  }
  return {};
}

Status read_fixed_convolutions(BlobReader& blobs, const Network& network, FixedPointNetwork& out) {
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  out.convolutions.resize(network.layers.size());
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    FixedPointConvolution& convolution = out.convolutions[i];
    const std::string name = concatenate({"fixed.", i});
    const uint32_t in_channels = shapes[layer.inputs[0]].channels;
    FIG_RETURN_IF_ERROR(blobs.read(name + ".weights",
                                   {layer.out_channels, layer.kernel, layer.kernel, in_channels},
                                   convolution.weights));
    FIG_RETURN_IF_ERROR(
        blobs.read(name + ".scale", {layer.out_channels}, convolution.weight_scale));
    FIG_RETURN_IF_ERROR(blobs.read(name + ".bias", {layer.out_channels}, convolution.bias));
  }
  return {};
}

namespace {

// A convolution without float weights is allowed only where none has any.
Status check_all_or_none(const Network& network) {
  const auto holds = [](const Layer& layer) {
    return !layer.weights.empty() || !layer.bias.empty();
  };
  if (std::none_of(network.layers.begin(), network.layers.end(), holds)) return {};
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d || (!layer.weights.empty() && !layer.bias.empty())) continue;
    return corrupt(concatenate({"network.", i, layer.weights.empty() ? ".weights" : ".bias"}),
                   "is missing, while others are there");
  }
  return {};
}

// All of them, or none if the network is there in fixed point.
Status read_float_weights(BlobReader& blobs, bool has_fixed_point, Network& out) {
  FIG_RETURN_IF_ERROR(read_convolutions(
      blobs, "network", has_fixed_point ? BlobReader::kMayBeAbsent : BlobReader::kRequired, out));
  return has_fixed_point ? check_all_or_none(out) : Status();
}

Status read_fixed_point(const schema::FixedPoint& table, BlobReader& blobs, const Network& network,
                        FixedPointNetwork& out) {
  for (const schema::Quantisation* entry : *table.values()) {
    if (out.values.size() == kMaxLayers)
      return over_limit("avatar.fixed_point", "more than ", kMaxLayers, " values");
    out.values.push_back({.scale = entry->scale(), .zero_point = entry->zero_point()});
  }
  FIG_RETURN_IF_ERROR(read_fixed_convolutions(blobs, network, out));
  if (!blobs.wanted().fixed_point) {
    out = {};
    return {};
  }
  return validate_fixed_point(network, out);
}

// In float, in fixed point, or both.
Status read_weights(const schema::Avatar& table, BlobReader& blobs, Avatar& out) {
  const bool has_fixed_point = table.fixed_point() != nullptr;
  if (!out.has_network()) {
    return has_fixed_point ? corrupt("avatar.fixed_point", "is there, a network is not") : Status();
  }
  FIG_RETURN_IF_ERROR(read_float_weights(blobs, has_fixed_point, out.network));
  return has_fixed_point
             ? read_fixed_point(*table.fixed_point(), blobs, out.network, out.fixed_point)
             : Status();
}

Status read_filters(const schema::Avatar& table, BlobReader& blobs, Avatar& out) {
  out.antialiased = table.antialiased();
  SmallestExtents& extents = out.smallest_extents;
  extents.scale_m = table.smallest_extent_scale_m();
  if (extents.scale_m == 0) return {};
  FIG_RETURN_IF_ERROR(blobs.read("filter.smallest_extent", {BlobReader::kAny}, extents.codes));
  return validate_smallest_extents(extents, out.texels_a_side());
}

}  // namespace

Status read_uv_size(uint32_t stated, const AvatarKind& kind, std::string_view owner,
                    uint32_t& out) {
  out = stated;
  const std::string field = concatenate({owner, ".uv_size"});
  if (stated > kMaxUvSize) return over_limit(field, "is larger than ", kMaxUvSize);
  const uint32_t of_network = kind.network.input_size;
  if (!kind.network.layers.empty()) {
    return grid_fits(stated != 0 ? stated : of_network, of_network)
               ? Status()
               : corrupt(field, "is not 1, 2, 4 or 8 times the network's input size");
  }
  if (stated == 0) return corrupt(field, "is missing, and there is no network");
  return kind.fourier_octaves == 0 ? Status()
                                   : corrupt(concatenate({owner, ".fourier_octaves"}),
                                             "is not 0, and there is no network");
}

Status read_static_part(const StaticGroupList* list, std::string_view owner, uint32_t uv_size,
                        BlobReader& blobs, StaticPart& out) {
  const uint32_t count = list == nullptr ? 0 : list->size();
  if (count > kStaticChannels) {
    return over_limit(concatenate({owner, ".static_groups"}), "has more than ", kStaticChannels,
                      " groups");
  }
  for (uint32_t g = 0; g < count; ++g) {
    const schema::StaticGroup& entry = *list->Get(g);
    StaticGroup& group = out.groups.emplace_back();
    const std::string name = concatenate({"static.", g});
    FIG_RETURN_IF_ERROR(blobs.read(name + ".scale", {BlobReader::kAny}, group.scale));
    group.first_channel = entry.first_channel();
    group.channels = static_cast<uint32_t>(group.scale.size());
    group.grid_size = entry.grid_size();
    FIG_RETURN_IF_ERROR(
        blobs.read(name + ".values", {BlobReader::kAny, group.channels}, group.values));
  }
  return validate_static_part(out, uv_size);
}

Status check_gaussians(const Budget& budget, uint32_t uv_size) {
  if (budget.gaussians > uint64_t{uv_size} * uv_size)
    return corrupt("budget.gaussians", "is more than the map has texels");
  return {};
}

Status check_network_fits(const AvatarKind& kind, const HeadDecoding& decoding,
                          std::string_view owner, const Budget& budget) {
  const std::vector<ValueShape> shapes = *infer_shapes(kind.network, false);
  if (kind.network.input_size > kMaxUvSize) {
    return over_limit("network.input_size", "is larger than ", kMaxUvSize);
  }
  if (kind.fourier_octaves > layout::kMaxFourierOctaves) {
    return over_limit(concatenate({owner, ".fourier_octaves"}), "is above ",
                      layout::kMaxFourierOctaves);
  }
  if (const uint32_t channels = kMapChannels + 4 * kind.fourier_octaves;
      kind.network.input_channels != channels) {
    return corrupt("network.input_channels", "is ", kind.network.input_channels,
                   ", maps and Fourier channels make ", channels);
  }
  if (shapes.back().size != kind.network.input_size)
    return corrupt("network", "the result does not have the size of the input");
  if (const uint32_t channels = head_channels(decoding.sh_degree);
      shapes.back().channels != channels) {
    return corrupt("network", "the result has ", shapes.back().channels,
                   " channels, the head needs ", channels);
  }
  uint64_t largest_value = 0;
  for (const ValueShape& shape : shapes) {
    largest_value =
        std::max(largest_value, uint64_t{shape.size} * shape.size * shape.channels * sizeof(float));
  }
  if (largest_value > layout::kMaxValueBytes)
    return over_limit("network", "an activation is larger than 1 GiB");
  if (budget.peak_memory_bytes != 0 && largest_value > budget.peak_memory_bytes) {
    return over_limit("budget.peak_memory_bytes", "declares ", budget.peak_memory_bytes,
                      ", one activation alone needs ", largest_value);
  }
  if (const uint64_t macs = count_macs(kind.network, shapes);
      budget.macs_per_frame != 0 && macs > budget.macs_per_frame) {
    return over_limit("budget.macs_per_frame", "declares ", budget.macs_per_frame,
                      ", the network needs ", macs);
  }
  return {};
}

namespace {

// Cholesky in double: succeeds exactly if the matrix is positive definite beyond rounding.
bool is_positive_definite(std::span<const float> matrix, size_t n) {
  std::vector<double> lower(n * n, 0.0);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      double sum = matrix[i * n + j];
      for (size_t k = 0; k < j; ++k) sum -= lower[i * n + k] * lower[j * n + k];
      if (i == j && !(sum > 0)) return false;
      lower[i * n + j] = i == j ? std::sqrt(sum) : sum / lower[j * n + j];
    }
  }
  return true;
}

}  // namespace

Status read_statistics_joints(const flatbuffers::Vector<uint8_t>& list, const std::string& field,
                              std::vector<uint8_t>& out) {
  if (list.size() < 1 || list.size() > kMaxJoints)
    return corrupt(field, "does not list 1 to 255 joints");
  out.assign(list.begin(), list.end());
  std::vector<uint8_t> sorted = out;
  std::sort(sorted.begin(), sorted.end());
  return std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end()
             ? Status()
             : corrupt(field, "lists a joint twice");
}

Status check_covariance(std::span<const float> covariance, size_t n, const std::string& field) {
  FIG_RETURN_IF_ERROR(check_magnitude(covariance, field, 1e4f));
  for (size_t i = 0; i < n; ++i) {
    if (!(covariance[i * n + i] > 0))
      return corrupt(field, "row ", i, ": the variance is not positive");
    for (size_t j = 0; j < i; ++j) {
      const float a = covariance[i * n + j], b = covariance[j * n + i];
      if (std::fabs(a - b) > 1e-6f * std::max(std::fabs(a), std::fabs(b))) {
        return corrupt(field, "is not symmetric in row ", i, ", column ", j);
      }
    }
  }
  const MemoryReserve reserve(n * n * sizeof(double));
  if (!reserve.held()) return no_memory();
  return is_positive_definite(covariance, n) ? Status()
                                             : corrupt(field, "is not positive definite");
}

Status read_pose_statistics(const schema::PoseStatistics& table, std::string_view owner,
                            BlobReader& blobs, PoseStatistics& out) {
  FIG_RETURN_IF_ERROR(read_statistics_joints(
      *table.joints(), concatenate({owner, ".pose_statistics.joints"}), out.joints));
  const uint32_t n = static_cast<uint32_t>(out.joints.size()) * 3;
  FIG_RETURN_IF_ERROR(blobs.read("pose.mean", {n}, out.mean));
  FIG_RETURN_IF_ERROR(blobs.read("pose.covariance", {n, n}, out.covariance));
  FIG_RETURN_IF_ERROR(
      blobs.read("pose.distances", {BlobReader::kAny}, out.distances, BlobReader::kMayBeAbsent));
  if (!blobs.wanted().pose_statistics) {
    out = {};
    return {};
  }
  FIG_RETURN_IF_ERROR(check_magnitude(out.mean, "pose.mean", 100));
  FIG_RETURN_IF_ERROR(check_covariance(out.covariance, n, "pose.covariance"));
  return out.distances.empty() ? Status() : validate_pose_distances(out.distances);
}

namespace {

// The image's size stands in the first chunk of every PNG.
Status check_png(std::span<const uint8_t> png, const Camera& camera) {
  constexpr uint8_t kStart[16] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n',
                                  0,    0,   0,   13,  'I',  'H',  'D',  'R'};
  if (png.size() < 33 || std::memcmp(png.data(), kStart, sizeof(kStart)) != 0)
    return corrupt("golden.png", "is not a PNG file");
  const auto big_endian = [&](size_t i) {
    return uint32_t{png[i]} << 24 | uint32_t{png[i + 1]} << 16 | uint32_t{png[i + 2]} << 8 |
           uint32_t{png[i + 3]};
  };
  if (big_endian(16) != camera.width_px || big_endian(20) != camera.height_px)
    return corrupt("golden.png", "does not have the golden camera's size");
  return {};
}

}  // namespace

Status read_golden_view(const schema::GoldenFrame& table, GoldenFrame& out) {
  const auto vec3 = [](const schema::Vec3& v) { return std::array<float, 3>{v.x(), v.y(), v.z()}; };
  out.root_translation_m = vec3(*table.root_translation_m());
  out.background = vec3(*table.background());
  const schema::Camera& camera = *table.camera();
  out.camera = {.width_px = camera.width_px(),
                .height_px = camera.height_px(),
                .fx_px = camera.fx_px(),
                .fy_px = camera.fy_px(),
                .cx_px = camera.cx_px(),
                .cy_px = camera.cy_px(),
                .near_m = camera.near_m()};
  for (uint32_t i = 0; i < 12; ++i)
    out.camera.view_from_world[i] = camera.view_from_world()->Get(i);
  if (const Status status = validate_camera(out.camera); !status.ok())
    return corrupt("golden", status.message());
  for (float channel : out.background) {
    if (!(channel >= 0 && channel <= 1))
      return corrupt("golden.background", "is not within 0 and 1");
  }
  return {};
}

Status check_golden_pose(const GoldenFrame& golden) {
  const size_t joints = golden.rotations.size() / 4;
  if (joints > kMaxJoints) return corrupt("golden.rotations", "has more than 255 joints");
  const Status status =
      validate_pose({golden.root_translation_m, golden.rotations}, static_cast<uint32_t>(joints));
  return status.ok() ? Status() : corrupt("golden", status.message());
}

Status read_golden(const schema::GoldenFrame& table, BlobReader& blobs, GoldenFrame& out) {
  FIG_RETURN_IF_ERROR(read_golden_view(table, out));
  FIG_RETURN_IF_ERROR(blobs.read("golden.rotations", {BlobReader::kAny, 4}, out.rotations));
  FIG_RETURN_IF_ERROR(check_golden_pose(out));
  out.fixed_point_hash = {table.fixed_point_hash_low(), table.fixed_point_hash_high()};
  if (table.fixed_point_library() != nullptr) {
    FIG_RETURN_IF_ERROR(read_text(table.fixed_point_library(), "golden.fixed_point_library",
                                  layout::kMaxNameBytes, out.fixed_point_library));
  }
  FIG_RETURN_IF_ERROR(
      blobs.read("golden.png", {BlobReader::kAny}, out.png, BlobReader::kMayBeAbsent));
  return out.png.empty() ? Status() : check_png(out.png, out.camera);
}

Status read_avatar(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                   Avatar& out) {
  const schema::Avatar& table = *index.content_as_Avatar();
  FIG_RETURN_IF_ERROR(read_text(index.name(), "avatar.name", layout::kMaxNameBytes, out.name));
  FIG_RETURN_IF_ERROR(read_kind(table, "avatar", out, NoNetwork::kAllowed));
  FIG_RETURN_IF_ERROR(
      blobs.read("avatar.shape", {BlobReader::kAny}, out.shape, BlobReader::kMayBeAbsent));
  if (out.shape.size() > kMaxShapeCoefficients) {
    return over_limit("avatar.shape", "has more than ", kMaxShapeCoefficients, " coefficients");
  }
  FIG_RETURN_IF_ERROR(check_magnitude(out.shape, "avatar.shape", 1000));
  FIG_RETURN_IF_ERROR(read_maps_and_head(table, "avatar", out));
  FIG_RETURN_IF_ERROR(read_weights(table, blobs, out));
  if (out.has_network())
    FIG_RETURN_IF_ERROR(check_network_fits(out, out.decoding, "avatar", budget));
  FIG_RETURN_IF_ERROR(read_uv_size(table.uv_size(), out, "avatar", out.uv_size));
  FIG_RETURN_IF_ERROR(check_gaussians(budget, out.texels_a_side()));
  FIG_RETURN_IF_ERROR(read_static_part(table.static_groups(), "avatar", out.texels_a_side(), blobs,
                                       out.static_part));
  if (!out.has_network() && out.static_part.empty())
    return corrupt("avatar", "has neither a network nor a static part");
  FIG_RETURN_IF_ERROR(read_filters(table, blobs, out));
  if (table.pose_statistics() != nullptr) {
    FIG_RETURN_IF_ERROR(
        read_pose_statistics(*table.pose_statistics(), "avatar", blobs, out.pose_statistics));
  }
  if (table.golden() != nullptr)
    FIG_RETURN_IF_ERROR(read_golden(*table.golden(), blobs, out.golden));
  // By the package, not by what is wanted of it.
  if (out.has_network() && table.fixed_point() == nullptr &&
      out.golden.fixed_point_hash != std::array<uint64_t, 2>{0, 0}) {
    return corrupt("golden.fixed_point_hash", "is there, a network in fixed point is not");
  }
  return {};
}

}  // namespace figurine
