// The meaning of a sampler package: a network that sampled weights fit, a space of weights and a
// denoiser whose arrays have the sizes that their shapes say and whose arithmetic is defined, a
// schedule and steps that a solver can take.
//
// What every product of sizes is at most: 257 tokens, 4096 directions each, 2^28 values each. 64
// bits hold all of them; a blob's length is 32 bits.
#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>

#include "figurine/detail/memory_reserve.h"
#include "formats/src/package/content.h"
#include "formats/src/package/text.h"

namespace figurine {

namespace {

// What a blob's length can be.
Status check_length(uint64_t length, const char* field) {
  return length <= std::numeric_limits<uint32_t>::max()
             ? Status()
             : over_limit(field, "would have more than 2^32 values");
}

Status read_quantisation(const schema::Sampler& table, Sampler& out) {
  if (table.values()->size() > kMaxLayers)
    return over_limit("sampler.values", "has more than ", kMaxLayers, " entries");
  for (const schema::Quantisation* entry : *table.values()) {
    out.values.push_back({.scale = entry->scale(), .zero_point = entry->zero_point()});
  }
  return validate_quantisation(out.network, out.values).within("sampler.values");
}

// What all its avatars share, up to their weights.
Status read_shared(const schema::Sampler& table, const Budget& budget, Sampler& out) {
  FIG_RETURN_IF_ERROR(read_kind(table, "sampler", out));
  out.shape_count = table.shape_count();
  if (out.shape_count > kMaxShapeCoefficients)
    return over_limit("sampler.shape_count", "is above ", kMaxShapeCoefficients);
  FIG_RETURN_IF_ERROR(read_maps_and_head(table, "sampler", out));
  FIG_RETURN_IF_ERROR(check_network_fits(out, out.decoding, "sampler", budget));
  FIG_RETURN_IF_ERROR(read_uv_size(table.uv_size(), out, "sampler", out.uv_size));
  FIG_RETURN_IF_ERROR(check_gaussians(budget, out.texels_a_side()));
  out.antialiased = table.antialiased();
  out.shares_network = table.shares_network();
  return read_quantisation(table, out);
}

// The network that all its avatars have, in floats and in integers.
Status read_shared_network(BlobReader& blobs, Sampler& out) {
  if (!out.shares_network) return {};
  FIG_RETURN_IF_ERROR(read_convolutions(blobs, "network", BlobReader::kRequired, out.network));
  out.fixed_point.values = out.values;
  FIG_RETURN_IF_ERROR(read_fixed_convolutions(blobs, out.network, out.fixed_point));
  return validate_fixed_point(out.network, out.fixed_point);
}

// Every row of 0 to count - 1, once.
bool is_permutation_of_rows(std::span<const uint32_t> rows) {
  std::vector<bool> seen(rows.size());
  for (const uint32_t row : rows) {
    if (row >= rows.size() || seen[row]) return false;
    seen[row] = true;
  }
  return true;
}

Status read_group(const schema::SampledStaticGroup& table, size_t number, BlobReader& blobs,
                  SampledStaticGroup& out) {
  const std::string name = concatenate({"static.", number});
  FIG_RETURN_IF_ERROR(blobs.read(name + ".scale", {BlobReader::kAny}, out.scale));
  FIG_RETURN_IF_ERROR(blobs.read(name + ".row", {BlobReader::kAny}, out.row));
  out.first_channel = table.first_channel();
  out.channels = static_cast<uint32_t>(out.scale.size());
  out.grid_size = table.grid_size();
  if (out.row.size() > uint64_t{kMaxUvSize} * kMaxUvSize)
    return over_limit(name + ".row", "has more rows than a map has texels");
  const MemoryReserve reserve(out.row.size() / 8);
  if (!reserve.held()) return no_memory();
  if (!is_permutation_of_rows(out.row))
    return corrupt(name + ".row", "does not name every row of its values once");
  if (table.patch_rows()->size() > layout::kMaxListEntries)
    return over_limit(name + ".patch_rows", "has more than ", layout::kMaxListEntries, " entries");
  uint64_t rows = 0;
  for (const uint32_t patch : *table.patch_rows()) {
    if (patch == 0) return corrupt(name + ".patch_rows", "a patch has no cells");
    rows += patch;
    out.patch_rows.push_back(patch);
  }
  if (rows != out.row.size())
    return corrupt(name + ".patch_rows", "count ", rows, " cells, ", name, ".row has ",
                   out.row.size());
  return {};
}

// Checked as the static part of an avatar whose integers are all 0.
Status read_groups(const schema::Sampler& table, BlobReader& blobs, Sampler& out) {
  const uint32_t count = table.static_groups() == nullptr ? 0 : table.static_groups()->size();
  if (count > kStaticChannels)
    return over_limit("sampler.static_groups", "has more than ", kStaticChannels, " groups");
  StaticPart part;
  size_t most = 0;
  for (uint32_t g = 0; g < count; ++g) {
    SampledStaticGroup& group = out.static_groups.emplace_back();
    FIG_RETURN_IF_ERROR(read_group(*table.static_groups()->Get(g), g, blobs, group));
    most = std::max(most, group.row.size() * std::min<size_t>(group.channels, kStaticChannels));
  }
  const MemoryReserve reserve(most);
  if (!reserve.held()) return no_memory();
  const std::vector<int8_t> zeros(most);
  for (const SampledStaticGroup& group : out.static_groups) {
    const size_t values = group.row.size() * std::min<size_t>(group.channels, kStaticChannels);
    part.groups.push_back({.first_channel = group.first_channel,
                           .channels = group.channels,
                           .grid_size = group.grid_size,
                           .values = std::span(zeros).first(values),
                           .scale = group.scale});
  }
  FIG_RETURN_IF_ERROR(validate_static_part(part, out.texels_a_side()));
  if (out.shares_network && out.static_groups.empty())
    return corrupt("sampler.shares_network", "is true, and there is no static part to sample");
  return {};
}

Status read_ranks(const schema::Sampler& table, size_t tokens, Sampler& out) {
  const auto& list = *table.ranks();
  if (list.size() != tokens)
    return corrupt("sampler.ranks", "has ", list.size(), " entries for ", tokens, " tokens");
  out.ranks.assign(list.begin(), list.end());
  for (size_t token = 0; token < tokens; ++token) {
    if (out.ranks[token] >= 1 && out.ranks[token] <= kMaxDenoiserWidth) continue;
    return corrupt("sampler.ranks", "token ", token, " has ", out.ranks[token],
                   " directions, not 1 to ", kMaxDenoiserWidth);
  }
  return {};
}

Status read_denoiser_shape(const schema::Denoiser& table, DenoiserShape& out) {
  out = {.d_model = table.d_model(),
         .blocks = table.blocks(),
         .heads = table.heads(),
         .feed_forward = table.feed_forward()};
  const auto within = [](uint32_t value, uint32_t max) { return value >= 1 && value <= max; };
  if (!within(out.d_model, kMaxDenoiserWidth))
    return corrupt("sampler.denoiser.d_model", "is not 1 to ", kMaxDenoiserWidth);
  if (!within(out.blocks, kMaxDenoiserBlocks))
    return corrupt("sampler.denoiser.blocks", "is not 1 to ", kMaxDenoiserBlocks);
  if (!within(out.feed_forward, kMaxDenoiserWidth))
    return corrupt("sampler.denoiser.feed_forward", "is not 1 to ", kMaxDenoiserWidth);
  if (!within(out.heads, kMaxDenoiserWidth) || out.d_model % (2 * out.heads) != 0) {
    return corrupt("sampler.denoiser.heads", "is ", out.heads,
                   ", of which two do not divide d_model ", out.d_model);
  }
  return {};
}

// By memchr, which looks at many bytes at once: these are a sampler's largest arrays.
Status check_symmetric(std::span<const int8_t> values, const char* field) {
  const void* found = std::memchr(values.data(), 0x80, values.size());
  if (found == nullptr) return {};
  return corrupt(field, "value ", static_cast<const int8_t*>(found) - values.data(),
                 " is -128; weights are symmetric");
}

Status read_floats(BlobReader& blobs, const char* name, std::initializer_list<uint32_t> shape,
                   std::span<const float>& out) {
  FIG_RETURN_IF_ERROR(blobs.read(name, shape, out));
  return check_magnitude(out, name, layout::kMaxSamplerValue);
}

// tokens: [L] their values.
Status read_space(BlobReader& blobs, std::span<const size_t> tokens, Sampler& out) {
  uint64_t values = 0, directions = 0, bytes = 0;
  for (size_t token = 0; token < tokens.size(); ++token) {
    values += tokens[token];
    directions += out.ranks[token];
    bytes += uint64_t{out.ranks[token]} * tokens[token];
  }
  FIG_RETURN_IF_ERROR(check_length(values, "space.mean"));
  FIG_RETURN_IF_ERROR(check_length(bytes, "space.directions"));
  FIG_RETURN_IF_ERROR(read_floats(blobs, "space.mean", {static_cast<uint32_t>(values)}, out.mean));
  FIG_RETURN_IF_ERROR(
      blobs.read("space.directions", {static_cast<uint32_t>(bytes)}, out.directions));
  FIG_RETURN_IF_ERROR(check_symmetric(out.directions, "space.directions"));
  FIG_RETURN_IF_ERROR(read_floats(blobs, "space.direction_scale",
                                  {static_cast<uint32_t>(directions)}, out.direction_scale));
  for (size_t k = 0; k < out.direction_scale.size(); ++k) {
    if (out.direction_scale[k] < 0)
      return corrupt("space.direction_scale", "value ", k, " is negative");
  }
  return {};
}

Status read_denoiser(BlobReader& blobs, Sampler& out) {
  uint64_t rows = 0, bytes = 0;
  for (const MatrixShape& matrix : denoiser_matrices(out.denoiser, out.ranks)) {
    rows += matrix.rows;
    bytes += uint64_t{matrix.rows} * matrix.columns;
  }
  FIG_RETURN_IF_ERROR(check_length(bytes, "denoiser.matrices"));
  const auto all_rows = static_cast<uint32_t>(rows),
             tokens = static_cast<uint32_t>(out.ranks.size());  // fewer rows than bytes
  FIG_RETURN_IF_ERROR(
      blobs.read("denoiser.matrices", {static_cast<uint32_t>(bytes)}, out.matrices));
  FIG_RETURN_IF_ERROR(check_symmetric(out.matrices, "denoiser.matrices"));
  FIG_RETURN_IF_ERROR(read_floats(blobs, "denoiser.row_scale", {all_rows}, out.row_scale));
  for (size_t n = 0; n < out.row_scale.size(); ++n) {
    if (out.row_scale[n] < std::numeric_limits<float>::min()) {
      return corrupt("denoiser.row_scale", "value ", n, " is not positive, or too small");
    }
  }
  FIG_RETURN_IF_ERROR(read_floats(blobs, "denoiser.bias", {all_rows}, out.bias));
  FIG_RETURN_IF_ERROR(
      read_floats(blobs, "denoiser.position", {tokens + 1, out.denoiser.d_model}, out.position));
  return read_floats(blobs, "denoiser.norm", {2 * out.denoiser.blocks + 1, 2, out.denoiser.d_model},
                     out.norm);
}

Status read_solver(uint32_t steps, schema::SolverMethod method, const std::string& field,
                   SolverMethod& out) {
  if (steps < 1 || steps > kMaxSolverSteps)
    return corrupt(field + ".steps", "is ", steps, ", not 1 to ", kMaxSolverSteps);
  if (method > schema::SolverMethod::MAX) return unsupported(field + ".method", "is unknown");
  out = static_cast<SolverMethod>(method);
  return {};
}

Status read_sampling(const schema::Sampler& table, Sampler& out) {
  const schema::NoiseSchedule& noise = *table.noise();
  out.noise = {.dimension = noise.dimension(),
               .noisy_dimension_snr = noise.noisy_dimension_snr(),
               .decided_dimension_snr = noise.decided_dimension_snr(),
               .clean_snr = noise.clean_snr(),
               .band_share = noise.band_share()};
  if (const auto schedule = NoiseSchedule::create(out.noise); !schedule.ok())
    return corrupt("sampler.noise", schedule.status().message());
  out.steps = table.steps();
  FIG_RETURN_IF_ERROR(read_solver(table.steps(), table.method(), "sampler", out.method));
  if (table.golden_seeds() == nullptr) return {};
  if (table.golden_seeds()->size() > layout::kMaxListEntries) {
    return over_limit("sampler.golden_seeds", "has more than ", layout::kMaxListEntries,
                      " entries");
  }
  for (const schema::GoldenSeed* entry : *table.golden_seeds()) {
    const std::string field = concatenate({"sampler.golden_seeds[", out.golden_seeds.size(), "]"});
    GoldenSeed& seed = out.golden_seeds.emplace_back();
    seed = {.seed = entry->seed(),
            .steps = entry->steps(),
            .hash = {entry->hash_low(), entry->hash_high()}};
    FIG_RETURN_IF_ERROR(read_solver(entry->steps(), entry->method(), field, seed.method));
  }
  return {};
}

// A picture or a hash would be of one avatar; the frame is drawn of whatever is sampled.
Status read_golden_frame(const schema::GoldenFrame& table, BlobReader& blobs, GoldenFrame& out) {
  FIG_RETURN_IF_ERROR(read_golden(table, blobs, out));
  if (!out.png.empty()) return corrupt("golden.png", "is there, a sampler has no picture");
  if (out.fixed_point_hash != std::array<uint64_t, 2>{0, 0})
    return corrupt("golden.fixed_point_hash", "is there, a sampler has none");
  return out.fixed_point_library.empty()
             ? Status()
             : corrupt("golden.fixed_point_library", "is there, a sampler has none");
}

Status read_report(BlobReader& blobs, std::string_view& out) {
  std::span<const uint8_t> bytes;
  FIG_RETURN_IF_ERROR(
      blobs.read("sampler.report", {BlobReader::kAny}, bytes, BlobReader::kMayBeAbsent));
  if (bytes.size() > layout::kMaxReportBytes)
    return over_limit("sampler.report", "is longer than ", layout::kMaxReportBytes, " bytes");
  out = {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  return is_clean_text(out, true)
             ? Status()
             : corrupt("sampler.report", "is not UTF-8 text without control characters");
}

}  // namespace

Status read_sampler(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                    Sampler& out) {
  const schema::Sampler& table = *index.content_as_Sampler();
  FIG_RETURN_IF_ERROR(read_text(index.name(), "sampler.name", layout::kMaxNameBytes, out.name));
  FIG_RETURN_IF_ERROR(read_shared(table, budget, out));
  FIG_RETURN_IF_ERROR(read_shared_network(blobs, out));
  FIG_RETURN_IF_ERROR(read_groups(table, blobs, out));
  const std::vector<size_t> tokens =
      sampler_token_sizes(out);  // the network's shapes are valid from here on
  FIG_RETURN_IF_ERROR(read_ranks(table, tokens.size(), out));
  FIG_RETURN_IF_ERROR(read_denoiser_shape(*table.denoiser(), out.denoiser));
  FIG_RETURN_IF_ERROR(read_space(blobs, tokens, out));
  FIG_RETURN_IF_ERROR(read_denoiser(blobs, out));
  FIG_RETURN_IF_ERROR(read_sampling(table, out));
  if (table.pose_statistics() != nullptr) {
    FIG_RETURN_IF_ERROR(
        read_pose_statistics(*table.pose_statistics(), "sampler", blobs, out.pose_statistics));
  }
  if (table.golden() != nullptr)
    FIG_RETURN_IF_ERROR(read_golden_frame(*table.golden(), blobs, out.golden));
  out.population_hash = {table.population_hash_low(), table.population_hash_high()};
  return read_report(blobs, out.report);
}

}  // namespace figurine
