#include "samples/inspect/describe.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <format>
#include <limits>

#include "samples/inspect/tensor_values.h"

namespace figurine::inspect {

namespace {

// The shortest decimal that is this float, as the double that prints so: 0.05, not
// 0.05000000074505806.
double number(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof(text), value).ptr;
  double shortest = value;
  std::from_chars(text, end, shortest);
  return shortest;
}

Json numbers(std::span<const float> values) {
  Json list = Json::array();
  for (float value : values) list.push_back(number(value));
  return list;
}

// What every package of version 1 means; the reader refuses others.
Json describe_conventions() {
  return {{"length_unit", "metre"},
          {"axes", "right-handed, y up; cameras OpenCV (x right, y down, z forward)"},
          {"colour_space", "sRGB-encoded as stored, straight alpha"},
          {"rotations", "unit quaternions wxyz, relative to the parent joint"},
          {"rest_frames",
           "world-aligned: a joint's rest transform is a translation to its rest position"}};
}

Json describe_provenance(const Provenance& provenance) {
  Json settings = Json::array(), quality = Json::object();
  for (const KeyValue& setting : provenance.settings)
    settings.push_back({{"key", setting.key}, {"value", setting.value}});
  for (const QualityMetric& metric : provenance.quality) quality[metric.name] = metric.value;
  return {{"tool", provenance.tool},
          {"created", provenance.created},
          {"settings", settings},
          {"sources", provenance.sources},
          {"quality", quality},
          {"authors", provenance.authors},
          {"licence_name", provenance.licence_name},
          {"licence_url", provenance.licence_url},
          {"avatar_permission", provenance.avatar_permission},
          {"commercial_usage", provenance.commercial_usage},
          {"depicted_person", provenance.depicted_person}};
}

// Degrees of the left arm below the horizontal at rest: 0 is a T-pose, about 45 an A-pose. Null if
// the joints have other names.
Json left_arm_below_horizontal(const Body& body) {
  const auto joint = [&](const char* name) {
    return std::ranges::find(body.joint_names, name) - body.joint_names.begin();
  };
  const auto shoulder = joint("left_shoulder"), wrist = joint("left_wrist"),
             end = std::ssize(body.joint_names);
  if (shoulder == end || wrist == end) return nullptr;
  double arm[3];
  for (int k = 0; k < 3; ++k)
    arm[k] = double(body.joint_position_m[wrist * 3 + k]) - body.joint_position_m[shoulder * 3 + k];
  const double degrees =
      std::atan2(-arm[1], std::hypot(arm[0], arm[2])) * 180 / 3.14159265358979323846;
  return std::round(degrees * 10) / 10;
}

Json describe_body(const Body& body) {
  float low[3], high[3];
  std::fill_n(low, 3, std::numeric_limits<float>::max());
  std::fill_n(high, 3, std::numeric_limits<float>::lowest());
  for (size_t i = 0; i < body.texel_position_m.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], body.texel_position_m[i]);
    high[i % 3] = std::max(high[i % 3], body.texel_position_m[i]);
  }
  Json joints = Json::array();
  for (uint32_t j = 0; j < body.joint_count(); ++j) {
    joints.push_back({{"name", body.joint_names[j]},
                      {"parent", body.parents[j]},
                      {"rest_position_m", numbers(body.joint_position_m.subspan(j * 3, 3))}});
  }
  Json out = {{"uv_size", body.uv_size},
              {"covered_texels", body.texel_count()},
              {"border_texels", body.border_texel.size()},
              {"shape_coefficients", body.shape_count()},
              {"rest_extent_m", {{"min", numbers(low)}, {"max", numbers(high)}}},
              {"left_arm_below_horizontal_deg", left_arm_below_horizontal(body)},
              {"joints", joints}};
  if (!body.texel_triangle.empty()) out["mesh_places"] = true;
  return out;
}

Json describe_motion(const Motion& motion) {
  return {
      {"frames", motion.frame_count},
      {"frames_per_second", number(motion.frames_per_second)},
      {"seconds", std::round(motion.frame_count / double(motion.frames_per_second) * 1000) / 1000},
      {"joints", motion.joint_names}};
}

std::string layer_name(const Layer& layer) {
  switch (layer.op) {
    case LayerOp::kConv2d:
      return std::format("conv {0}x{0}{1}", layer.kernel, layer.relu ? " relu" : "");
    case LayerOp::kMaxPool2:
      return "max pool 2x2";
    case LayerOp::kUpsample2:
      return "upsample x2";
    case LayerOp::kConcat:
      return "concat";
  }
  return "";
}

Json describe_network(const Network& network) {
  if (network.layers.empty()) return nullptr;
  const std::vector<ValueShape> shapes = infer_shapes(network, false).value();
  Json layers = Json::array();
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    Json inputs = Json::array({layer.inputs[0]});
    if (layer.op == LayerOp::kConcat) inputs.push_back(layer.inputs[1]);
    layers.push_back({{"op", layer_name(layer)},
                      {"inputs", inputs},
                      {"size", shapes[i + 1].size},
                      {"channels", shapes[i + 1].channels}});
  }
  return {{"input", {{"size", network.input_size}, {"channels", network.input_channels}}},
          {"parameters", count_parameters(network)},
          {"macs", count_macs(network, shapes)},
          {"layers", layers}};
}

Json describe_golden(const GoldenFrame& golden) {
  if (golden.rotations.empty()) return nullptr;
  return {{"joints", golden.rotations.size() / 4},
          {"root_translation_m", numbers(golden.root_translation_m)},
          {"width_px", golden.camera.width_px},
          {"height_px", golden.camera.height_px},
          {"focal_px", {number(golden.camera.fx_px), number(golden.camera.fy_px)}},
          {"principal_point_px", {number(golden.camera.cx_px), number(golden.camera.cy_px)}},
          {"near_m", number(golden.camera.near_m)},
          {"view_from_world", numbers(golden.camera.view_from_world)},
          {"background", numbers(golden.background)},
          {"png_bytes", golden.png.size()},
          {"fixed_point_hash", golden.fixed_point_hash == std::array<uint64_t, 2>{0, 0}
                                   ? Json()
                                   : Json(format_hash(golden.fixed_point_hash))},
          {"fixed_point_library", golden.fixed_point_library}};
}

Json describe_precisions(const Avatar& avatar) {
  Json list = Json::array();
  for (const Precision precision : {Precision::kFloat32, Precision::kFixedPoint}) {
    if (avatar.holds(precision)) list.push_back(to_string(precision));
  }
  return list;
}

Json describe_fixed_point(const Avatar& avatar) {
  const FixedPointNetwork& fixed = avatar.fixed_point;
  if (fixed.empty()) return nullptr;
  uint64_t bytes = 0;
  Json layers = Json::array();
  for (size_t i = 0; i < avatar.network.layers.size(); ++i) {
    const FixedPointConvolution& convolution = fixed.convolutions[i];
    const uint64_t layer_bytes = convolution.weights.size_bytes() +
                                 convolution.weight_scale.size_bytes() +
                                 convolution.bias.size_bytes();
    bytes += layer_bytes;
    Json layer = {{"op", layer_name(avatar.network.layers[i])}, {"bytes", layer_bytes}};
    if (const auto& scales = convolution.weight_scale; !scales.empty()) {
      const auto [low, high] = std::ranges::minmax(scales);
      layer["weight_scale"] = {{"min", number(low)}, {"max", number(high)}};
    }
    const bool is_head = i + 1 == avatar.network.layers.size();  // its result is float
    layer["scale"] = is_head ? Json() : Json(number(fixed.values[i + 1].scale));
    layer["zero_point"] = is_head ? Json() : Json(fixed.values[i + 1].zero_point);
    layers.push_back(layer);
  }
  return {{"bytes", bytes}, {"input_scale", number(fixed.values[0].scale)}, {"layers", layers}};
}

Json describe_static_part(const StaticPart& part) {
  if (part.empty()) return nullptr;
  uint64_t bytes = 0;
  Json groups = Json::array();
  for (const StaticGroup& group : part.groups) {
    const uint64_t group_bytes = group.values.size_bytes() + group.scale.size_bytes();
    const auto [low, high] = std::ranges::minmax(group.scale);
    groups.push_back({{"first_channel", group.first_channel},
                      {"channels", group.channels},
                      {"grid_size", group.grid_size},
                      {"cells", group.values.size() / group.channels},
                      {"bytes", group_bytes},
                      {"scale", {{"min", number(low)}, {"max", number(high)}}}});
    bytes += group_bytes;
  }
  return {{"bytes", bytes}, {"groups", groups}};
}

Json describe_smallest_extents(const SmallestExtents& extents) {
  if (extents.empty()) return nullptr;
  const auto [low, high] = std::ranges::minmax(extents.codes);
  return {{"bytes", extents.codes.size_bytes()},
          {"scale_m", number(extents.scale_m)},
          {"min_m", number(extents.scale_m * static_cast<float>(low))},
          {"max_m", number(extents.scale_m * static_cast<float>(high))}};
}

// How far the training poses are from their mean.
Json describe_distances(std::span<const float> distances) {
  if (distances.empty()) return nullptr;
  return {{"count", distances.size()},
          {"min", number(distances.front())},
          {"median", number(distances[distances.size() / 2])},
          {"max", number(distances.back())}};
}

const char* template_name(TemplateMode mode) {
  return mode == TemplateMode::kMean ? "mean" : "shaped";
}

Json describe_decoding(const HeadDecoding& decoding) {
  Json json{{"offset_scale_m", number(decoding.offset_scale_m)},
            {"spacing_scale", number(decoding.spacing_scale)},
            {"max_log_scale", number(decoding.max_log_scale)},
            {"opacity_bias", number(decoding.opacity_bias)},
            {"sh_degree", decoding.sh_degree}};
  if (decoding.max_offset != 0) json["max_offset"] = number(decoding.max_offset);
  return json;
}

// The first lines of whatever is of a kind; `rest` follows.
Json describe_kind(const AvatarKind& kind, const Json& rest) {
  Json json{{"body", {{"name", kind.body_name}, {"hash", format_hash(kind.body_hash)}}},
            {"preset", kind.preset},
            {"template", template_name(kind.template_mode)}};
  json.update(rest);
  return json;
}

Json describe_avatar(const Avatar& avatar) {
  return describe_kind(avatar,
                       {{"shape", numbers(avatar.shape)},
                        {"uv_size", avatar.texels_a_side()},
                        {"fourier_octaves", avatar.fourier_octaves},
                        {"map_mean", numbers(avatar.map_statistics.mean)},
                        {"map_scale", numbers(avatar.map_statistics.scale)},
                        {"decoding", describe_decoding(avatar.decoding)},
                        {"network", describe_network(avatar.network)},
                        {"precisions", describe_precisions(avatar)},
                        {"fixed_point", describe_fixed_point(avatar)},
                        {"static_part", describe_static_part(avatar.static_part)},
                        {"smallest_extents", describe_smallest_extents(avatar.smallest_extents)},
                        {"antialiased", avatar.antialiased},
                        {"pose_statistics_joints", avatar.pose_statistics.joints},
                        {"pose_distances", describe_distances(avatar.pose_statistics.distances)},
                        {"golden", describe_golden(avatar.golden)}});
}

Json describe_member(const Package& package, size_t m) {
  const Population& population = package.population();
  const PopulationMember& member = population.members[m];
  const Provenance whole = package.member_provenance(m);
  // What the member has beside the package: behind the package's own entries.
  Provenance own = whole;
  own.settings.erase(own.settings.begin(),
                     own.settings.begin() + std::ssize(package.provenance().settings));
  own.sources.erase(own.sources.begin(),
                    own.sources.begin() + std::ssize(package.provenance().sources));
  const size_t coefficients = population.shape.size() / population.size();
  return {{"number", m},
          {"name", member.name},
          {"split", to_string(member.split)},
          {"difference_bytes", difference_bytes(population, m)},
          {"shape", numbers(population.shape.subspan(m * coefficients, coefficients))},
          {"map_mean", numbers(member.map_statistics.mean)},
          {"map_scale", numbers(member.map_statistics.scale)},
          {"decoding", describe_decoding(member.decoding)},
          {"golden", describe_golden(member.golden)},
          {"provenance", describe_provenance(own)}};
}

Json describe_population(const Package& package) {
  const Population& population = package.population();
  Json members = Json::array();
  for (size_t m = 0; m < population.size(); ++m) members.push_back(describe_member(package, m));
  return describe_kind(population, {{"uv_size", population.texels_a_side()},
                                    {"fourier_octaves", population.fourier_octaves},
                                    {"network", describe_network(population.network)},
                                    {"coding", to_string(population.coding)},
                                    {"static_part", describe_static_part(population.static_part)},
                                    {"antialiased", population.antialiased},
                                    {"pose_statistics_joints", population.pose_joints},
                                    {"quality_names", population.quality_names},
                                    {"members", members}});
}

// [{op, scale, zero_point}] of every layer's output; the last one's is float.
Json describe_quantisation(const Network& network, std::span<const Quantisation> values) {
  Json layers = Json::array();
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const bool is_head = i + 1 == network.layers.size();
    layers.push_back({{"op", layer_name(network.layers[i])},
                      {"scale", is_head ? Json() : Json(number(values[i + 1].scale))},
                      {"zero_point", is_head ? Json() : Json(values[i + 1].zero_point)}});
  }
  return {{"input_scale", number(values[0].scale)}, {"layers", layers}};
}

Json describe_space(const Sampler& sampler) {
  const std::vector<size_t> sizes = sampler_token_sizes(sampler);
  Json tokens = Json::array();
  const auto add = [&](const std::string& name) {
    const size_t token = tokens.size();
    tokens.push_back({{"name", name}, {"values", sizes[token]}, {"rank", sampler.ranks[token]}});
  };
  for (size_t i = 0; i < sampler.network.layers.size(); ++i) {
    if (sampler.network.layers[i].op == LayerOp::kConv2d && !sampler.shares_network)
      add(std::format("layer {}", i));
  }
  if (sampler.shape_count > 0) add("shape");
  for (size_t g = 0; g < sampler.static_groups.size(); ++g) {
    for (size_t p = 0; p < sampler.static_groups[g].patch_rows.size(); ++p)
      add(std::format("static {} {}", g, p));
  }
  return {{"values", sampler.mean.size()},
          {"directions", sampler.direction_scale.size()},
          {"bytes", sampler.mean.size_bytes() + sampler.directions.size_bytes() +
                        sampler.direction_scale.size_bytes()},
          {"tokens", tokens}};
}

Json describe_denoiser(const Sampler& sampler) {
  const size_t floats = sampler.bias.size() + sampler.position.size() + sampler.norm.size();
  return {{"d_model", sampler.denoiser.d_model},
          {"blocks", sampler.denoiser.blocks},
          {"heads", sampler.denoiser.heads},
          {"feed_forward", sampler.denoiser.feed_forward},
          {"parameters", sampler.matrices.size() + floats},
          {"bytes", sampler.matrices.size_bytes() + sampler.row_scale.size_bytes() +
                        floats * sizeof(float)}};
}

Json describe_golden_seeds(const Sampler& sampler) {
  Json list = Json::array();
  for (const GoldenSeed& golden : sampler.golden_seeds) {
    list.push_back({{"seed", golden.seed},
                    {"steps", golden.steps},
                    {"method", to_string(golden.method)},
                    {"hash", format_hash(golden.hash)}});
  }
  return list;
}

// JSON nests without bound, and whoever walks a document does so on the stack: what is deeper than
// any report needs stays a text.
Json describe_report(std::string_view report) {
  constexpr int kMaxDepth = 32;
  if (report.empty()) return nullptr;
  bool too_deep = false;
  const auto keep = [&](int depth, Json::parse_event_t, Json&) {
    too_deep |= depth > kMaxDepth;
    return depth <= kMaxDepth;
  };
  Json parsed = Json::parse(report, keep, false);
  return too_deep || parsed.is_discarded() ? Json(report) : parsed;
}

Json describe_static_groups(const Sampler& sampler) {
  Json groups = Json::array();
  for (const SampledStaticGroup& group : sampler.static_groups) {
    groups.push_back({{"first_channel", group.first_channel},
                      {"channels", group.channels},
                      {"grid_size", group.grid_size},
                      {"cells", group.row.size()},
                      {"patches", group.patch_rows.size()},
                      {"scale", numbers(group.scale)}});
  }
  return groups;
}

Json describe_sampler(const Sampler& sampler) {
  const NoiseScheduleOptions& noise = sampler.noise;
  return describe_kind(sampler,
                       {{"shape_coefficients", sampler.shape_count},
                        {"uv_size", sampler.texels_a_side()},
                        {"shares_network", sampler.shares_network},
                        {"static_groups", describe_static_groups(sampler)},
                        {"antialiased", sampler.antialiased},
                        {"fourier_octaves", sampler.fourier_octaves},
                        {"map_mean", numbers(sampler.map_statistics.mean)},
                        {"map_scale", numbers(sampler.map_statistics.scale)},
                        {"decoding", describe_decoding(sampler.decoding)},
                        {"network", describe_network(sampler.network)},
                        {"quantisation", describe_quantisation(sampler.network, sampler.values)},
                        {"pose_statistics_joints", sampler.pose_statistics.joints},
                        {"golden", describe_golden(sampler.golden)},
                        {"space", describe_space(sampler)},
                        {"denoiser", describe_denoiser(sampler)},
                        {"noise",
                         {{"dimension", noise.dimension},
                          {"noisy_dimension_snr", noise.noisy_dimension_snr},
                          {"decided_dimension_snr", noise.decided_dimension_snr},
                          {"clean_snr", noise.clean_snr},
                          {"band_share", noise.band_share}}},
                        {"steps", sampler.steps},
                        {"method", to_string(sampler.method)},
                        {"golden_seeds", describe_golden_seeds(sampler)},
                        {"population_hash", format_hash(sampler.population_hash)},
                        {"report", describe_report(sampler.report)}});
}

// Bytes of the file by what they are: header, index, blobs by the first word of their names in the
// order of the file, and the zeros between.
Json describe_parts(const Package& package) {
  Json parts{{"header", kPackageHeaderBytes}, {"index", package.index_bytes()}};
  uint64_t sum = kPackageHeaderBytes + package.index_bytes();
  for (const TensorInfo& tensor : package.tensors()) {
    const std::string name = tensor.name.substr(0, tensor.name.find('.'));
    parts[name] = parts.value(name, uint64_t{0}) + tensor.size_bytes;
    sum += tensor.size_bytes;
  }
  parts["padding"] = package.size_bytes() - sum;
  return parts;
}

}  // namespace

Json describe(const Package& package, const std::string& path) {
  const Budget& budget = package.budget();
  Json document = {{"file", path},
                   {"format", "fgn"},
                   {"version", package.version()},
                   {"kind", to_string(package.kind())},
                   {"name", ""},
                   {"content_hash", format_hash(package.content_hash())},
                   {"size_bytes", package.size_bytes()},
                   {"parts", describe_parts(package)},
                   {"required_features", package.required_features()},
                   {"optional_features", package.optional_features()},
                   {"budget",
                    {{"peak_memory_bytes", budget.peak_memory_bytes},
                     {"macs_per_frame", budget.macs_per_frame},
                     {"gaussians", budget.gaussians}}},
                   {"conventions", describe_conventions()}};
  switch (package.kind()) {
    case PackageKind::kBody:
      document["name"] = package.body().name;
      document["body"] = describe_body(package.body());
      break;
    case PackageKind::kAvatar:
      document["name"] = package.avatar().name;
      document["avatar"] = describe_avatar(package.avatar());
      break;
    case PackageKind::kMotion:
      document["name"] = package.motion().name;
      document["motion"] = describe_motion(package.motion());
      break;
    case PackageKind::kPopulation:
      document["name"] = package.population().name;
      document["population"] = describe_population(package);
      break;
    case PackageKind::kSampler:
      document["name"] = package.sampler().name;
      document["sampler"] = describe_sampler(package.sampler());
      break;
  }
  document["provenance"] = describe_provenance(package.provenance());
  return document;
}

Json describe_tensors(const Package& package, std::span<const std::byte> bytes) {
  Json list = Json::array();
  for (const TensorInfo& tensor : package.tensors()) {
    const TensorValues values(tensor, bytes);
    double low = values[0], high = values[0], sum = 0;
    for (size_t i = 0; i < values.count(); ++i) {
      low = std::min(low, values[i]);
      high = std::max(high, values[i]);
      sum += values[i];
    }
    const double mean = sum / static_cast<double>(values.count());
    const bool is_float = tensor.type == DataType::kF32 || tensor.type == DataType::kF16;
    list.push_back({{"name", tensor.name},
                    {"type", to_string(tensor.type)},
                    {"shape", tensor.shape},
                    {"offset_bytes", tensor.offset_bytes},
                    {"size_bytes", tensor.size_bytes},
                    {"min", is_float ? number(static_cast<float>(low)) : low},
                    {"max", is_float ? number(static_cast<float>(high)) : high},
                    {"mean", number(static_cast<float>(mean))},
                    {"checksum", std::format("{:016x}", tensor.checksum)}});
  }
  return list;
}

}  // namespace figurine::inspect
