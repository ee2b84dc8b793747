// Parts to bytes. The index is built twice: once to learn its size, which the blobs' places follow
// from, and once with those places in it (extents are structs, so its size does not depend on
// them).
#include <cstring>

#include "formats/src/package/checksum.h"
#include "formats/src/package/layout.h"
#include "formats/writer/package_parts.h"
#include "package_generated.h"

namespace figurine {

namespace {

using flatbuffers::FlatBufferBuilder;
using flatbuffers::Offset;

template <class Entry, class Build>
auto build_list(FlatBufferBuilder& builder, const std::vector<Entry>& entries, Build build) {
  std::vector<decltype(build(entries[0]))> offsets;
  for (const Entry& entry : entries) offsets.push_back(build(entry));
  return builder.CreateVector(offsets);
}

Offset<schema::Provenance> build_provenance(FlatBufferBuilder& b, const Provenance& p) {
  const auto text = [&](const std::string& value) { return b.CreateString(value); };
  const auto tool = text(p.tool), created = text(p.created);
  const auto settings = build_list(b, p.settings, [&](const KeyValue& entry) {
    const auto value = text(entry.value);  // one after the other: the order of arguments, and with
                                           // it the bytes, is the compiler's choice
    return schema::CreateSetting(b, text(entry.key), value);
  });
  const auto sources = build_list(b, p.sources, text);
  const auto quality = build_list(b, p.quality, [&](const QualityMetric& entry) {
    return schema::CreateQualityMetric(b, text(entry.name), entry.value);
  });
  const auto licence_name = text(p.licence_name), licence_url = text(p.licence_url);
  const auto authors = build_list(b, p.authors, text);
  const auto avatar_permission = text(p.avatar_permission),
             commercial_usage = text(p.commercial_usage), person = text(p.depicted_person);
  return schema::CreateProvenance(b, tool, created, settings, sources, quality, licence_name,
                                  licence_url, authors, avatar_permission, commercial_usage,
                                  person);
}

Offset<void> build_content(FlatBufferBuilder& b, const Body& body) {
  const auto names = build_list(b, body.joint_names,
                                [&](const std::string& name) { return b.CreateString(name); });
  return schema::CreateBody(b, body.uv_size, names).Union();
}

Offset<void> build_content(FlatBufferBuilder& b, const Motion& motion) {
  const auto names = build_list(b, motion.joint_names,
                                [&](const std::string& name) { return b.CreateString(name); });
  return schema::CreateMotion(b, motion.frames_per_second, names).Union();
}

Offset<schema::GoldenFrame> build_golden(FlatBufferBuilder& b, const GoldenFrame& golden) {
  if (golden.rotations.empty()) return 0;
  const Camera& c = golden.camera;
  const schema::Camera camera(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.near_m,
                              flatbuffers::span<const float, 12>(c.view_from_world.data(), 12));
  const auto vec3 = [](const std::array<float, 3>& v) { return schema::Vec3(v[0], v[1], v[2]); };
  const schema::Vec3 translation = vec3(golden.root_translation_m),
                     background = vec3(golden.background);
  Offset<flatbuffers::String> library = 0;
  if (!golden.fixed_point_library.empty()) library = b.CreateString(golden.fixed_point_library);
  return schema::CreateGoldenFrame(b, &translation, &camera, &background,
                                   golden.fixed_point_hash[0], golden.fixed_point_hash[1], library);
}

Offset<flatbuffers::Vector<const schema::Quantisation*>> build_quantisation(
    FlatBufferBuilder& b, const std::vector<Quantisation>& values) {
  std::vector<schema::Quantisation> structs;
  for (const Quantisation& value : values) structs.emplace_back(value.scale, value.zero_point);
  return b.CreateVectorOfStructs(structs);
}

Offset<schema::FixedPoint> build_fixed_point(FlatBufferBuilder& b, const FixedPointNetwork& fixed) {
  if (fixed.empty()) return 0;
  return schema::CreateFixedPoint(b, build_quantisation(b, fixed.values));
}

schema::MapStatistics build_map_statistics(const MapStatistics& statistics) {
  return {flatbuffers::span<const float, 6>(statistics.mean.data(), 6),
          flatbuffers::span<const float, 6>(statistics.scale.data(), 6)};
}

Offset<schema::HeadDecoding> build_decoding(FlatBufferBuilder& b, const HeadDecoding& d) {
  return schema::CreateHeadDecoding(b, d.offset_scale_m, d.spacing_scale, d.max_log_scale,
                                    d.opacity_bias, d.sh_degree, d.max_offset);
}

Offset<schema::Network> build_network(FlatBufferBuilder& b, const Network& network) {
  const auto layers = build_list(b, network.layers, [&](const Layer& layer) {
    return schema::CreateLayer(b, static_cast<schema::LayerOp>(layer.op), layer.inputs[0],
                               layer.inputs[1], layer.out_channels, layer.kernel, layer.relu);
  });
  return schema::CreateNetwork(b, network.input_size, network.input_channels, layers);
}

Offset<schema::PoseStatistics> build_pose_statistics(FlatBufferBuilder& b,
                                                     const PoseStatistics& statistics) {
  return statistics.joints.empty()
             ? 0
             : schema::CreatePoseStatistics(b, b.CreateVector(statistics.joints));
}

// No empty list, so that an avatar without a static part has the bytes that it always had.
Offset<flatbuffers::Vector<Offset<schema::StaticGroup>>> build_static_groups(
    FlatBufferBuilder& b, const StaticPart& part) {
  if (part.empty()) return 0;
  return build_list(b, part.groups, [&](const StaticGroup& group) {
    return schema::CreateStaticGroup(b, group.first_channel, group.grid_size);
  });
}

Offset<void> build_content(FlatBufferBuilder& b, const Avatar& avatar) {
  const auto body_name = b.CreateString(avatar.body_name), preset = b.CreateString(avatar.preset);
  const schema::MapStatistics statistics = build_map_statistics(avatar.map_statistics);
  const auto decoding = build_decoding(b, avatar.decoding);
  const auto network = build_network(b, avatar.network);
  const auto pose_statistics = build_pose_statistics(b, avatar.pose_statistics);
  const auto golden = build_golden(b, avatar.golden);
  const auto fixed_point = build_fixed_point(b, avatar.fixed_point);
  const auto static_groups = build_static_groups(b, avatar.static_part);
  const uint32_t uv_size = avatar.texels_a_side() != avatar.network.input_size ? avatar.uv_size : 0;
  return schema::CreateAvatar(b, body_name, avatar.body_hash[0], avatar.body_hash[1], preset,
                              static_cast<schema::TemplateMode>(avatar.template_mode), &statistics,
                              avatar.fourier_octaves, decoding, network, pose_statistics, golden,
                              fixed_point, static_groups, uv_size, avatar.smallest_extents.scale_m,
                              avatar.antialiased)
      .Union();
}

// Strings that a table may lack: nothing for an empty one. One after the other, as everywhere: the
// order decides the bytes.
Offset<flatbuffers::String> build_text(FlatBufferBuilder& b, const std::string& text) {
  return text.empty() ? 0 : b.CreateString(text);
}

Offset<flatbuffers::Vector<Offset<flatbuffers::String>>> build_texts(
    FlatBufferBuilder& b, const std::vector<std::string>& texts) {
  if (texts.empty()) return 0;
  return build_list(b, texts, [&](const std::string& text) { return b.CreateString(text); });
}

Offset<schema::Member> build_member(FlatBufferBuilder& b, const PopulationMember& member,
                                    const Provenance& own) {
  std::vector<std::string> flat;
  for (const KeyValue& setting : own.settings)
    flat.insert(flat.end(), {setting.key, setting.value});
  const auto name = b.CreateString(member.name);
  const auto decoding = build_decoding(b, member.decoding);
  const auto golden = build_golden(b, member.golden);
  Offset<flatbuffers::Vector<double>> quality = 0;
  if (!member.quality.empty()) quality = b.CreateVector(member.quality);
  const auto settings = build_texts(b, flat);
  const auto sources = build_texts(b, own.sources);
  const auto authors = build_texts(b, own.authors);
  const auto tool = build_text(b, own.tool);
  const auto created = build_text(b, own.created);
  const auto licence_name = build_text(b, own.licence_name);
  const auto licence_url = build_text(b, own.licence_url);
  const auto permission = build_text(b, own.avatar_permission);
  const auto usage = build_text(b, own.commercial_usage);
  const auto person = build_text(b, own.depicted_person);
  const schema::MapStatistics statistics = build_map_statistics(member.map_statistics);
  return schema::CreateMember(b, name, static_cast<schema::Split>(member.split), &statistics,
                              decoding, golden, quality, settings, sources, tool, created,
                              licence_name, licence_url, authors, permission, usage, person);
}

Offset<void> build_content(FlatBufferBuilder& b, const Population& population,
                           std::span<const Provenance> own) {
  const auto body_name = b.CreateString(population.body_name);
  const auto preset = b.CreateString(population.preset);
  const auto network = build_network(b, population.network);
  const auto quality_names = build_texts(b, population.quality_names);
  Offset<flatbuffers::Vector<uint8_t>> pose_joints = 0;
  if (!population.pose_joints.empty()) pose_joints = b.CreateVector(population.pose_joints);
  std::vector<Offset<schema::Member>> members;
  for (size_t m = 0; m < population.size(); ++m)
    members.push_back(build_member(b, population.members[m], own[m]));
  const auto member_list = b.CreateVector(members);
  const auto static_groups = build_static_groups(b, population.static_part);
  const uint32_t uv_size =
      population.texels_a_side() != population.network.input_size ? population.uv_size : 0;
  return schema::CreatePopulation(
             b, body_name, population.body_hash[0], population.body_hash[1], preset,
             static_cast<schema::TemplateMode>(population.template_mode),
             population.fourier_octaves, network,
             static_cast<schema::DifferenceCoding>(population.coding), quality_names, pose_joints,
             member_list, uv_size, static_groups, population.antialiased)
      .Union();
}

Offset<void> build_content(FlatBufferBuilder& b, const Sampler& sampler) {
  const auto body_name = b.CreateString(sampler.body_name);
  const auto preset = b.CreateString(sampler.preset);
  const auto network = build_network(b, sampler.network);
  const schema::MapStatistics statistics = build_map_statistics(sampler.map_statistics);
  const auto decoding = build_decoding(b, sampler.decoding);
  const auto values = build_quantisation(b, sampler.values);
  const auto pose_statistics = build_pose_statistics(b, sampler.pose_statistics);
  const auto golden = build_golden(b, sampler.golden);
  const auto ranks = b.CreateVector(sampler.ranks);
  const DenoiserShape& d = sampler.denoiser;
  const auto denoiser = schema::CreateDenoiser(b, d.d_model, d.blocks, d.heads, d.feed_forward);
  const NoiseScheduleOptions& n = sampler.noise;
  const auto noise = schema::CreateNoiseSchedule(
      b, n.dimension, n.noisy_dimension_snr, n.decided_dimension_snr, n.clean_snr, n.band_share);
  const auto method = [](SolverMethod value) { return static_cast<schema::SolverMethod>(value); };
  const auto golden_seeds = build_list(b, sampler.golden_seeds, [&](const GoldenSeed& golden_seed) {
    return schema::CreateGoldenSeed(b, golden_seed.seed, golden_seed.steps,
                                    method(golden_seed.method), golden_seed.hash[0],
                                    golden_seed.hash[1]);
  });
  // No empty list, and no side that follows from the network: other samplers keep their bytes.
  Offset<flatbuffers::Vector<Offset<schema::SampledStaticGroup>>> static_groups = 0;
  if (!sampler.static_groups.empty()) {
    static_groups = build_list(b, sampler.static_groups, [&](const SampledStaticGroup& group) {
      const auto rows = b.CreateVector(group.patch_rows);
      return schema::CreateSampledStaticGroup(b, group.first_channel, group.grid_size, rows);
    });
  }
  const uint32_t uv_size =
      sampler.texels_a_side() != sampler.network.input_size ? sampler.uv_size : 0;
  return schema::CreateSampler(b, body_name, sampler.body_hash[0], sampler.body_hash[1], preset,
                               static_cast<schema::TemplateMode>(sampler.template_mode),
                               sampler.fourier_octaves, network, sampler.shape_count, &statistics,
                               decoding, values, pose_statistics, golden, ranks, denoiser, noise,
                               sampler.steps, method(sampler.method), golden_seeds,
                               sampler.population_hash[0], sampler.population_hash[1], uv_size,
                               static_groups, sampler.antialiased, sampler.shares_network)
      .Union();
}

Offset<void> build_content(FlatBufferBuilder& b, const PackageParts& parts) {
  if (const auto* population = std::get_if<const Population*>(&parts.content))
    return build_content(b, **population, parts.member_provenance);
  if (const auto* sampler = std::get_if<const Sampler*>(&parts.content))
    return build_content(b, **sampler);
  if (const auto* avatar = std::get_if<const Avatar*>(&parts.content))
    return build_content(b, **avatar);
  if (const auto* motion = std::get_if<const Motion*>(&parts.content))
    return build_content(b, **motion);
  return build_content(b, **std::get_if<const Body*>(&parts.content));
}

void build_index(FlatBufferBuilder& b, const PackageParts& parts,
                 const std::vector<schema::Extent>& extents) {
  const auto name =
      std::visit([&](const auto* content) { return b.CreateString(content->name); }, parts.content);
  const schema::Conventions conventions(schema::LengthUnit::Metre, schema::Axes::RightHandedYUp,
                                        schema::ColourSpace::SrgbEncodedStraightAlpha,
                                        schema::RotationFormat::QuaternionWxyz,
                                        schema::RestFrames::WorldAligned);
  const auto budget = schema::CreateBudget(b, parts.budget.peak_memory_bytes,
                                           parts.budget.macs_per_frame, parts.budget.gaussians);
  const auto provenance = build_provenance(b, parts.provenance);
  const auto content = build_content(b, parts);
  std::vector<Offset<schema::Blob>> blobs;
  for (size_t i = 0; i < parts.blobs.size(); ++i) {
    const BlobPart& part = parts.blobs[i];
    const auto blob_name = b.CreateString(part.name);
    const auto shape = b.CreateVector(part.shape);
    blobs.push_back(schema::CreateBlob(b, blob_name, part.optional,
                                       static_cast<schema::ElementType>(part.type), shape,
                                       &extents[i]));
  }
  const auto content_type = static_cast<schema::Content>(parts.content.index() + 1);
  b.Finish(schema::CreateIndex(b, name, &conventions, budget, provenance, content_type, content,
                               b.CreateVector(blobs)));
}

}  // namespace

std::vector<std::byte> assemble(const PackageParts& parts) {
  std::vector<schema::Extent> extents(parts.blobs.size());
  FlatBufferBuilder sized, placed;
  build_index(sized, parts, extents);
  uint64_t cursor = kPackageHeaderBytes + sized.GetSize();
  for (size_t i = 0; i < extents.size(); ++i) {
    const std::span<const std::byte> blob = parts.blobs[i].bytes;
    extents[i] = schema::Extent(layout::align_up(cursor), blob.size(), xxh3_64(blob));
    cursor = extents[i].offset() + blob.size();
  }
  build_index(placed, parts, extents);
  FIG_CHECK(placed.GetSize() == sized.GetSize(), "the index has one size");

  std::vector<std::byte> bytes(layout::align_up(cursor), std::byte{0});
  const std::span<const std::byte> index(
      reinterpret_cast<const std::byte*>(placed.GetBufferPointer()), placed.GetSize());
  std::memcpy(bytes.data() + kPackageHeaderBytes, index.data(), index.size());
  for (size_t i = 0; i < extents.size(); ++i) {
    if (!parts.blobs[i].bytes.empty())
      std::memcpy(bytes.data() + extents[i].offset(), parts.blobs[i].bytes.data(),
                  parts.blobs[i].bytes.size());
  }
  layout::Header header{.kind = static_cast<uint32_t>(parts.kind),
                        .required_features = parts.required_features,
                        .optional_features = parts.optional_features,
                        .file_bytes = bytes.size(),
                        .index_bytes = static_cast<uint32_t>(index.size()),
                        .index_checksum = xxh3_64(index)};
  std::memcpy(bytes.data(), &header, sizeof(header));
  header.header_checksum =
      xxh3_64(std::span<const std::byte>(bytes).first(layout::kSealedHeaderBytes));
  std::memcpy(bytes.data(), &header, sizeof(header));
  return bytes;
}

}  // namespace figurine
