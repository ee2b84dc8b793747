#include "formats/package_bytes.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "figurine/known_poses.h"
#include "figurine/texel_grid.h"
#include "formats/src/package/checksum.h"
#include "formats/src/package/text.h"
#include "formats/writer/package_writer.h"

namespace figurine::samples {

ExactBytes::ExactBytes(std::span<const std::byte> source) {
  void* memory = nullptr;
  FIG_CHECK(posix_memalign(&memory, kBlobAlignment, source.size()) == 0, "out of memory");
  if (!source.empty()) std::memcpy(memory, source.data(), source.size());
  bytes_ = {static_cast<std::byte*>(memory), source.size()};
}

ExactBytes::~ExactBytes() { std::free(bytes_.data()); }

GuardedBytes::GuardedBytes(size_t capacity) {
  const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  const size_t inner = (capacity + page - 1) / page * page;
  map_bytes_ = inner + 2 * page;
  void* map = mmap(nullptr, map_bytes_, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  FIG_CHECK(map != MAP_FAILED, "mmap failed");
  map_ = static_cast<std::byte*>(map);
  FIG_CHECK(mprotect(map_ + page, inner, PROT_READ | PROT_WRITE) == 0, "mprotect failed");
  end_ = map_ + page + inner;
}

GuardedBytes::~GuardedBytes() { munmap(map_, map_bytes_); }

Seal::Seal(std::span<const std::byte> sound_package) {
  const AlignedBytes copy(sound_package);
  const Result<Package> package = Package::open(copy.bytes(), "sample");
  FIG_CHECK(package.ok(), package.status().message().c_str());
  const layout::Header header = get_header(sound_package);
  for (const TensorInfo& tensor : package->tensors()) {
    const uint64_t extent[3] = {tensor.offset_bytes, tensor.size_bytes, tensor.checksum};
    const std::byte* begin = sound_package.data() + header.index_offset;
    const void* found = memmem(begin, header.index_bytes, extent, sizeof(extent));
    FIG_CHECK(found != nullptr, "the extent is in the index");
    extents_.push_back(
        static_cast<size_t>(static_cast<const std::byte*>(found) - sound_package.data()));
  }
}

void Seal::renew(std::span<std::byte> bytes) const {
  for (size_t at : extents_) {
    if (at + 24 > bytes.size()) continue;
    const uint64_t offset = get_u64(bytes, at), size = get_u64(bytes, at + 8);
    if (offset <= bytes.size() && size <= bytes.size() - offset)
      put_u64(bytes, at + 16, xxh3_64(bytes.subspan(offset, size)));
  }
  if (bytes.size() < kPackageHeaderBytes) return;
  layout::Header header = get_header(bytes);
  if (header.index_offset <= bytes.size() &&
      header.index_bytes <= bytes.size() - header.index_offset) {
    header.index_checksum = xxh3_64(bytes.subspan(header.index_offset, header.index_bytes));
  }
  put_header(bytes, header);
}

void renew_what_looks_like_a_package(std::span<std::byte> bytes) {
  if (bytes.size() < kPackageHeaderBytes) return;
  layout::Header header = get_header(bytes);
  header.magic = layout::kMagic;
  header.version = kPackageVersion;
  header.required_features &= layout::kKnownRequiredFeatures;
  header.file_bytes = bytes.size();
  header.index_offset = kPackageHeaderBytes;
  const size_t index_bytes =
      std::min<size_t>(header.index_bytes, bytes.size() - kPackageHeaderBytes);
  header.index_bytes = static_cast<uint32_t>(index_bytes);
  // Whatever could be an extent of the index is given the checksum of what it covers.
  for (size_t at = kPackageHeaderBytes; at + 24 <= kPackageHeaderBytes + index_bytes; at += 8) {
    const uint64_t offset = get_u64(bytes, at), size = get_u64(bytes, at + 8);
    if (offset % kBlobAlignment != 0 || offset < kPackageHeaderBytes + index_bytes ||
        offset > bytes.size())
      continue;
    if (size != 0 && size <= bytes.size() - offset)
      put_u64(bytes, at + 16, xxh3_64(bytes.subspan(offset, size)));
  }
  header.index_checksum = xxh3_64(bytes.subspan(kPackageHeaderBytes, index_bytes));
  put_header(bytes, header);
}

layout::Header get_header(std::span<const std::byte> bytes) {
  layout::Header header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  return header;
}

void put_header(std::span<std::byte> bytes, layout::Header header) {
  std::memcpy(bytes.data(), &header, sizeof(header));
  header.header_checksum = xxh3_64(bytes.first(layout::kSealedHeaderBytes));
  std::memcpy(bytes.data(), &header, sizeof(header));
}

void put_u64(std::span<std::byte> bytes, size_t at, uint64_t value) {
  std::memcpy(bytes.data() + at, &value, sizeof(value));
}

uint64_t get_u64(std::span<const std::byte> bytes, size_t at) {
  uint64_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

namespace {

bool all_finite(std::span<const float> values) {
  for (float value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

bool exercise_body(const Body& body, std::string& reason) {
  std::vector<float> rotations(size_t{body.joint_count()} * 4, 0.5f);
  std::vector<Affine> scratch(body.joint_count());
  std::vector<float> maps(size_t{body.uv_size} * body.uv_size * kMapChannels, std::nanf(""));
  draw_pose_maps(body, {{0, 0, 0}, rotations}, MapStatistics{}, scratch, kMapChannels, maps);
  const std::vector<float> shape(body.shape_count(), 0.5f);
  std::vector<float> joints(body.joint_position_m.size()), texels(body.texel_position_m.size());
  shape_body(body, shape, joints, texels);
  reason = "a posed map or a shaped texel is not finite";
  return all_finite(maps) && all_finite(joints) && all_finite(texels);
}

bool exercise_fixed_point(const Avatar& avatar, const std::vector<ValueShape>& shapes) {
  if (!avatar.holds(Precision::kFixedPoint)) return avatar.holds(Precision::kFloat32);
  if (!validate_fixed_point(avatar.network, avatar.fixed_point).ok()) return false;
  if (count_macs(avatar.network, shapes) > 10'000'000) return true;  // a mutation may ask for hours
  const std::vector<int16_t> input(size_t{shapes[0].size} * shapes[0].size * shapes[0].channels,
                                   -32767);
  return all_finite(evaluate_fixed_point(avatar.network, avatar.fixed_point, input).result);
}

// Its network's shapes, weights and arithmetic; the avatar has one.
bool exercise_network(const Avatar& avatar, std::string& reason) {
  reason = "shapes or weights of the network";
  const Result<std::vector<ValueShape>> shapes =
      infer_shapes(avatar.network, avatar.holds(Precision::kFloat32));
  if (!shapes.ok() || shapes->back().channels != head_channels(avatar.decoding.sh_degree))
    return false;
  if (!grid_fits(avatar.texels_a_side(), avatar.network.input_size)) return false;
  for (const Layer& layer : avatar.network.layers) {
    if (!all_finite(layer.weights) || !all_finite(layer.bias)) return false;
  }
  reason = "a network in fixed point";
  return exercise_fixed_point(avatar, *shapes);
}

// Every value as the device computes it, and e^s of the colours.
bool exercise_static_part(const Avatar& avatar) {
  if (avatar.static_part.empty()) return avatar.has_network();
  if (!validate_static_part(avatar.static_part, avatar.texels_a_side()).ok()) return false;
  for (const StaticGroup& group : avatar.static_part.groups) {
    for (size_t i = 0; i < group.values.size(); ++i) {
      const auto c = static_cast<uint32_t>(i % group.channels);
      const float value = group.scale[c] * static_cast<float>(group.values[i]);
      if (!std::isfinite(std::exp(group.first_channel + c < kStaticColour ? 0 : value)))
        return false;
      if (!(std::fabs(value) <= kMaxStaticValue)) return false;
    }
  }
  return true;
}

// Every extent as the device computes it: its square, if it is not zero, is normal.
bool exercise_smallest_extents(const Avatar& avatar) {
  const SmallestExtents& extents = avatar.smallest_extents;
  if (!validate_smallest_extents(extents, avatar.texels_a_side()).ok()) return false;
  for (size_t i = 0; i < extents.codes.size(); ++i) {
    const float s = extents.extent_m(i);
    if (!(s >= 0) || !(extents.codes[i] == 0 ? s == 0 : std::isnormal(s * s))) return false;
  }
  return true;
}

bool exercise_golden(const GoldenFrame& golden) {
  if (golden.rotations.empty()) return golden.png.empty();
  const uint32_t joints = static_cast<uint32_t>(golden.rotations.size() / 4);
  return validate_camera(golden.camera).ok() &&
         validate_pose({golden.root_translation_m, golden.rotations}, joints).ok();
}

// What a device asks of them, of a pose far from any.
bool exercise_known_poses(const PoseStatistics& statistics) {
  if (statistics.distances.empty()) return true;
  const Result<KnownPoses> known = KnownPoses::create(statistics);
  if (!known.ok()) return false;
  std::vector<float> rotations, pulled(4 * size_t{kMaxJoints});
  for (uint32_t joint = 0; joint < kMaxJoints; ++joint)
    rotations.insert(rotations.end(), {0.5f, 0.75f, -0.25f, 0.5f});
  const PoseRarity rarity = known->rarity(rotations);
  known->pull(rotations, pulled);
  return std::isfinite(rarity.distance) && rarity.share_beyond >= 0 && rarity.share_beyond <= 1 &&
         all_finite(pulled);
}

bool exercise_avatar(const Avatar& avatar, std::string& reason) {
  if (avatar.has_network() && !exercise_network(avatar, reason)) return false;
  reason = "a static part";
  if (!exercise_static_part(avatar)) return false;
  reason = "smallest extents";
  if (!exercise_smallest_extents(avatar)) return false;
  reason = "shape or pose statistics";
  const size_t features = avatar.pose_statistics.joints.size() * 3;
  if (avatar.pose_statistics.mean.size() != features ||
      avatar.pose_statistics.covariance.size() != features * features)
    return false;
  if (!all_finite(avatar.shape) || !all_finite(avatar.pose_statistics.mean) ||
      !all_finite(avatar.pose_statistics.covariance))
    return false;
  reason = "known poses";
  if (!exercise_known_poses(avatar.pose_statistics)) return false;
  reason = "golden frame";
  return exercise_golden(avatar.golden);
}

// Every member as an avatar, in storage that ends where its floats end.
bool exercise_population(const Population& population, std::string& reason) {
  const size_t floats = member_floats(population);
  for (size_t m = 0; m < population.size(); ++m) {
    const ExactBytes storage(std::vector<std::byte>(floats * sizeof(float)));
    const Avatar avatar =
        open_member(population, m, {reinterpret_cast<float*>(storage.bytes().data()), floats});
    if (!exercise_avatar(avatar, reason)) return false;
    reason = "a member's name or quality";
    if (find_member(population, avatar.name) != m ||
        population.members[m].quality.size() != population.quality_names.size())
      return false;
  }
  return true;
}

// What a device does with a sampler, with its products in plain loops: the first direction of every
// token to weights, an evaluation of each matrix, the noise levels of its steps.
bool exercise_sampler(const Sampler& sampler, std::string& reason) {
  reason = "the values' quantisation";
  if (!validate_quantisation(sampler.network, sampler.values).ok()) return false;
  reason = "the space of weights";
  const std::vector<size_t> tokens = sampler_token_sizes(sampler);
  if (sampler.ranks.size() != tokens.size()) return false;
  size_t value = 0, direction = 0, byte = 0;
  for (size_t token = 0; token < tokens.size(); ++token) {
    for (size_t k = 0; k < sampler.ranks[token]; ++k, ++direction) {
      for (size_t i = 0; i < tokens[token]; ++i, ++byte) {
        const int8_t q = sampler.directions[byte];
        if (q < -127 || !std::isfinite(sampler.mean[value + i] +
                                       sampler.direction_scale[direction] * static_cast<float>(q)))
          return false;
      }
    }
    value += tokens[token];
  }
  if (value != sampler.mean.size() || direction != sampler.direction_scale.size() ||
      byte != sampler.directions.size())
    return false;
  reason = "the denoiser";
  size_t row = 0;
  byte = 0;
  for (const MatrixShape& matrix : denoiser_matrices(sampler.denoiser, sampler.ranks)) {
    for (uint32_t n = 0; n < matrix.rows; ++n, ++row) {
      float sum = 0;
      for (uint32_t k = 0; k < matrix.columns; ++k)
        sum += static_cast<float>(sampler.matrices[byte++]);
      if (!std::isfinite(sampler.row_scale[row] * sum + sampler.bias[row]) ||
          !(sampler.row_scale[row] > 0))
        return false;
    }
  }
  const size_t d = sampler.denoiser.d_model;
  if (byte != sampler.matrices.size() || row != sampler.bias.size() ||
      sampler.position.size() != (tokens.size() + 1) * d)
    return false;
  if (sampler.norm.size() != (2 * sampler.denoiser.blocks + 1) * 2 * d ||
      d % (2 * sampler.denoiser.heads) != 0)
    return false;
  if (!all_finite(sampler.position) || !all_finite(sampler.norm)) return false;
  reason = "the noise schedule";
  const Result<NoiseSchedule> schedule = NoiseSchedule::create(sampler.noise);
  if (!schedule.ok()) return false;
  std::vector<NoiseLevel> levels(size_t{sampler.steps} + 1);
  solver_levels(*schedule, true, levels);
  for (const GoldenSeed& golden : sampler.golden_seeds) {
    if (golden.steps < 1 || golden.steps > kMaxSolverSteps) return false;
  }
  reason = "pose statistics, golden pose or report";
  const size_t features = sampler.pose_statistics.joints.size() * 3;
  if (sampler.pose_statistics.mean.size() != features ||
      sampler.pose_statistics.covariance.size() != features * features)
    return false;
  return is_clean_text(sampler.report, true) && sampler.golden.png.empty() &&
         exercise_golden(sampler.golden);
}

}  // namespace

bool exercise(const Package& package, std::string& reason) {
  switch (package.kind()) {
    case PackageKind::kBody:
      return exercise_body(package.body(), reason);
    case PackageKind::kAvatar:
      return exercise_avatar(package.avatar(), reason);
    case PackageKind::kMotion: {
      const Motion& motion = package.motion();
      reason = "a pose";
      for (uint32_t frame = 0; frame < motion.frame_count; ++frame) {
        if (!validate_pose(motion.pose(frame), static_cast<uint32_t>(motion.joint_names.size()))
                 .ok())
          return false;
      }
      return true;
    }
    case PackageKind::kPopulation: {
      for (size_t m = 0; m < package.population().size(); ++m)
        static_cast<void>(package.member_provenance(m));
      return exercise_population(package.population(), reason);
    }
    case PackageKind::kSampler:
      return exercise_sampler(package.sampler(), reason);
  }
  reason = "an unknown kind";
  return false;
}

}  // namespace figurine::samples
