#include "figurine/package.h"

#include <algorithm>

#include <cmath>
#include <variant>

#include "figurine/detail/memory_reserve.h"
#include "formats/src/package/checksum.h"
#include "formats/src/package/content.h"
#include "formats/src/package/reading_bytes.h"

namespace figurine {

const char* to_string(PackageKind kind) {
  switch (kind) {
    case PackageKind::kBody:
      return "body";
    case PackageKind::kAvatar:
      return "avatar";
    case PackageKind::kMotion:
      return "motion";
    case PackageKind::kPopulation:
      return "population";
    case PackageKind::kSampler:
      return "sampler";
  }
  return "unknown";
}

const char* to_string(DataType type) {
  switch (type) {
    case DataType::kF32:
      return "f32";
    case DataType::kU8:
      return "u8";
    case DataType::kI16:
      return "i16";
    case DataType::kU32:
      return "u32";
    case DataType::kI8:
      return "i8";
    case DataType::kI32:
      return "i32";
    case DataType::kF16:
      return "f16";
  }
  return "unknown";
}

const char* to_string(Precision precision) {
  return precision == Precision::kFixedPoint ? "q8" : "f32";
}

size_t size_bytes(DataType type) {
  switch (type) {
    case DataType::kU8:
    case DataType::kI8:
      return 1;
    case DataType::kI16:
    case DataType::kF16:
      return 2;
    case DataType::kF32:
    case DataType::kU32:
    case DataType::kI32:
      return 4;
  }
  return 0;
}

struct Package::Contents {
  layout::Header header;
  std::array<uint64_t, 2> content_hash{0, 0};
  std::variant<Body, Avatar, Motion, PopulationContent, Sampler> content;
  Budget budget;
  Provenance provenance;
  std::vector<TensorInfo> tensors;
};

Package::Package(std::unique_ptr<Contents> contents) : contents_(std::move(contents)) {}
Package::Package(Package&&) noexcept = default;
Package& Package::operator=(Package&&) noexcept = default;
Package::~Package() = default;

namespace {

using Content = std::variant<Body, Avatar, Motion, PopulationContent, Sampler>;

bool has_bounded_offsets(const Content& content) {
  const auto bounded = [](const HeadDecoding& decoding) { return decoding.max_offset != 0; };
  if (const Avatar* avatar = std::get_if<Avatar>(&content)) return bounded(avatar->decoding);
  if (const Sampler* sampler = std::get_if<Sampler>(&content)) return bounded(sampler->decoding);
  const PopulationContent* of_many = std::get_if<PopulationContent>(&content);
  return of_many != nullptr &&
         std::any_of(of_many->population.members.begin(), of_many->population.members.end(),
                     [&](const PopulationMember& member) { return bounded(member.decoding); });
}

Status check_feature(const layout::Header& header, uint64_t feature, bool held, const char* bit,
                     const char* thing) {
  const bool promised = (header.required_features & feature) != 0;
  if (promised == held) return {};
  return corrupt("header.required_features", "the bit of ", bit, " is ", promised ? "" : "not ",
                 "set, such ", thing, held ? "" : "not ", "there");
}

// The header promises what the content holds, so that a reader of the header alone can tell.
// The index says whether there is fixed point, wanted or not.
Status check_features(const layout::Header& header, const schema::Index& index,
                      const Content& content) {
  const Avatar* avatar = std::get_if<Avatar>(&content);
  const PopulationContent* of_many = std::get_if<PopulationContent>(&content);
  const Sampler* sampler = std::get_if<Sampler>(&content);
  const auto needs = [&](auto feature) {
    return avatar != nullptr    ? feature(*avatar)
           : of_many != nullptr ? feature(of_many->population)
                                : sampler != nullptr && feature(*sampler);
  };
  const bool has_static =
                 needs([](const auto& held) { return layout::needs_static_feature(held); }),
             has_filters =
                 needs([](const auto& held) { return layout::needs_filter_feature(held); });
  FIG_RETURN_IF_ERROR(
      check_feature(header, kFeatureFixedPoint,
                    (avatar != nullptr && index.content_as_Avatar()->fixed_point() != nullptr) ||
                        (sampler != nullptr && sampler->shares_network),
                    "fixed point", "a network is "));
  FIG_RETURN_IF_ERROR(
      check_feature(header, kFeatureStaticPart, has_static, "static parts", "an avatar is "));
  FIG_RETURN_IF_ERROR(
      check_feature(header, kFeatureFilters, has_filters, "filters", "an avatar is "));
  return check_feature(header, kFeatureBoundedOffsets, has_bounded_offsets(content),
                       "bounded offsets", "a decoding is ");
}

}  // namespace

Result<PackageIdentity> Package::identify(std::span<const std::byte> bytes,
                                          const std::string& name) {
  const MemoryReserve messages;
  if (!messages.held()) return no_memory();
  const Result<Container> container = open_index(bytes);
  if (!container.ok()) return container.status().within(name);
  return PackageIdentity{.kind = static_cast<PackageKind>(container->header.kind),
                         .version = container->header.version,
                         .content_hash = container->content_hash};
}

Result<Package> Package::open(std::span<const std::byte> bytes, const std::string& name,
                              const OpenOptions& options) {
  const MemoryReserve messages;
  if (!messages.held()) return no_memory();
  const Result<Container> indexed = open_index(bytes);
  if (!indexed.ok()) return indexed.status().within(name);
  const Result<uint64_t> reading_bytes = find_reading_bytes(*indexed->index);
  if (!reading_bytes.ok()) return reading_bytes.status().within(name);
  const MemoryReserve contents_reserve(*reading_bytes);
  if (!contents_reserve.held()) return no_memory().within(name);
  const Result<Container> container = open_blobs(*indexed, bytes, options);
  if (!container.ok()) return container.status().within(name);

  auto contents = std::make_unique<Contents>();
  contents->header = container->header;
  contents->content_hash = container->content_hash;
  const auto read = [&]() -> Status {
    const schema::Index& index = *container->index;
    FIG_RETURN_IF_ERROR(read_conventions(*index.conventions()));
    contents->budget = {.peak_memory_bytes = index.budget()->peak_memory_bytes(),
                        .macs_per_frame = index.budget()->macs_per_frame(),
                        .gaussians = index.budget()->gaussians()};
    FIG_RETURN_IF_ERROR(read_provenance(*index.provenance(), contents->provenance));
    BlobReader blobs(*container);
    switch (static_cast<PackageKind>(container->header.kind)) {
      case PackageKind::kBody:
        FIG_RETURN_IF_ERROR(read_body(index, blobs, contents->content.emplace<Body>()));
        break;
      case PackageKind::kAvatar:
        FIG_RETURN_IF_ERROR(
            read_avatar(index, blobs, contents->budget, contents->content.emplace<Avatar>()));
        break;
      case PackageKind::kMotion:
        FIG_RETURN_IF_ERROR(read_motion(index, blobs, contents->content.emplace<Motion>()));
        break;
      case PackageKind::kPopulation:
        FIG_RETURN_IF_ERROR(read_population(index, blobs, contents->budget,
                                            contents->content.emplace<PopulationContent>()));
        break;
      case PackageKind::kSampler:
        FIG_RETURN_IF_ERROR(
            read_sampler(index, blobs, contents->budget, contents->content.emplace<Sampler>()));
        break;
    }
    FIG_RETURN_IF_ERROR(check_features(contents->header, index, contents->content));
    return blobs.check_all_known();
  };
  if (const Status status = read(); !status.ok()) return status.within(name);
  for (const BlobView& blob : container->blobs) contents->tensors.push_back(blob.info);
  return Package(std::move(contents));
}

PackageKind Package::kind() const { return static_cast<PackageKind>(contents_->header.kind); }
uint32_t Package::version() const { return contents_->header.version; }
uint64_t Package::required_features() const { return contents_->header.required_features; }
uint64_t Package::optional_features() const { return contents_->header.optional_features; }
std::array<uint64_t, 2> Package::content_hash() const { return contents_->content_hash; }
const Budget& Package::budget() const { return contents_->budget; }
const Provenance& Package::provenance() const { return contents_->provenance; }
const std::vector<TensorInfo>& Package::tensors() const { return contents_->tensors; }
uint64_t Package::size_bytes() const { return contents_->header.file_bytes; }
uint64_t Package::index_bytes() const { return contents_->header.index_bytes; }

const Body& Package::body() const {
  FIG_CHECK(kind() == PackageKind::kBody, "the package is not a body");
  return *std::get_if<Body>(&contents_->content);
}

const Avatar& Package::avatar() const {
  FIG_CHECK(kind() == PackageKind::kAvatar, "the package is not an avatar");
  return *std::get_if<Avatar>(&contents_->content);
}

const Motion& Package::motion() const {
  FIG_CHECK(kind() == PackageKind::kMotion, "the package is not a motion");
  return *std::get_if<Motion>(&contents_->content);
}

const Population& Package::population() const {
  FIG_CHECK(kind() == PackageKind::kPopulation, "the package is not a population");
  return std::get_if<PopulationContent>(&contents_->content)->population;
}

const Sampler& Package::sampler() const {
  FIG_CHECK(kind() == PackageKind::kSampler, "the package is not a sampler");
  return *std::get_if<Sampler>(&contents_->content);
}

Provenance Package::member_provenance(size_t member) const {
  const Population& all = population();
  FIG_CHECK(member < all.size(), "a member of the population");
  const Provenance& own = std::get_if<PopulationContent>(&contents_->content)->own[member];
  Provenance merged = contents_->provenance;
  for (std::string Provenance::* text : kProvenanceTexts) {
    if (!(own.*text).empty()) merged.*text = own.*text;
  }
  if (!own.authors.empty()) merged.authors = own.authors;
  merged.settings.insert(merged.settings.end(), own.settings.begin(), own.settings.end());
  merged.sources.insert(merged.sources.end(), own.sources.begin(), own.sources.end());
  merged.quality.clear();
  for (size_t k = 0; k < all.members[member].quality.size(); ++k) {
    if (!std::isnan(all.members[member].quality[k]))
      merged.quality.push_back({all.quality_names[k], all.members[member].quality[k]});
  }
  return merged;
}

std::string format_hash(const std::array<uint64_t, 2>& hash) {
  std::string digits;
  for (const uint64_t half : {hash[1], hash[0]}) {
    for (int shift = 60; shift >= 0; shift -= 4) digits += "0123456789abcdef"[half >> shift & 15];
  }
  return digits;
}

std::array<uint64_t, 2> hash_picture(std::span<const uint8_t> rgba8) {
  return xxh3_128(std::as_bytes(rgba8));
}

std::array<uint64_t, 2> hash_weights(const FixedPointNetwork& fixed, std::span<const float> shape,
                                     const StaticPart& static_part) {
  std::vector<std::span<const std::byte>> parts;
  for (const FixedPointConvolution& convolution : fixed.convolutions) {
    for (const std::span<const std::byte> part :
         {std::as_bytes(convolution.weights), std::as_bytes(convolution.weight_scale),
          std::as_bytes(convolution.bias)}) {
      parts.push_back(part);
    }
  }
  parts.push_back(std::as_bytes(shape));
  for (const StaticGroup& group : static_part.groups) {
    parts.push_back(std::as_bytes(group.values));
    parts.push_back(std::as_bytes(group.scale));
  }
  return xxh3_128(parts);
}

Status check_avatar_fits_body(const Avatar& avatar, const Package& package) {
  const auto mismatch = [&](std::initializer_list<Word> why) {
    return refuse(StatusCode::kMismatch,
                  concatenate({"avatar '", avatar.name, "' does not fit the body"}), why);
  };
  if (package.kind() != PackageKind::kBody)
    return mismatch({"the other package is of kind ", to_string(package.kind())});
  const Body& body = package.body();
  if (avatar.body_hash != package.content_hash()) {
    return mismatch({"made for '", avatar.body_name, "' ", format_hash(avatar.body_hash),
                     ", this is '", body.name, "' ", format_hash(package.content_hash())});
  }
  if (avatar.texels_a_side() != body.uv_size) {
    return mismatch(
        {"its map has ", avatar.texels_a_side(), " texels a side, the body's ", body.uv_size});
  }
  if (const Status status = validate_static_part(avatar.static_part, body); !status.ok())
    return mismatch({status.message()});
  if (const Status status = validate_smallest_extents(avatar.smallest_extents, body); !status.ok())
    return mismatch({status.message()});
  if (avatar.shape.size() > body.shape_count()) {
    return mismatch(
        {"it has ", avatar.shape.size(), " shape coefficients, the body ", body.shape_count()});
  }
  if (!avatar.golden.rotations.empty() &&
      avatar.golden.rotations.size() != size_t{body.joint_count()} * 4) {
    return mismatch({"its golden pose has ", avatar.golden.rotations.size() / 4,
                     " joints, the body ", body.joint_count()});
  }
  for (uint8_t joint : avatar.pose_statistics.joints) {
    if (joint >= body.joint_count()) return mismatch({"its pose statistics name joint ", joint});
  }
  return {};
}

Status check_motion_fits_body(const Motion& motion, const Body& body) {
  const auto mismatch = [&](std::initializer_list<Word> why) {
    return refuse(
        StatusCode::kMismatch,
        concatenate({"motion '", motion.name, "' does not fit the body '", body.name, "'"}), why);
  };
  if (motion.joint_names.size() != body.joint_names.size()) {
    return mismatch(
        {"it has ", motion.joint_names.size(), " joints, the body ", body.joint_names.size()});
  }
  for (size_t j = 0; j < body.joint_names.size(); ++j) {
    if (motion.joint_names[j] == body.joint_names[j]) continue;
    return mismatch({"its joint ", j, " is '", motion.joint_names[j], "', the body's '",
                     body.joint_names[j], "'"});
  }
  return {};
}

}  // namespace figurine
