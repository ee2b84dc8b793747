#include "formats/src/package/container.h"

#include <cstring>
#include <limits>
#include <set>

#include "formats/src/package/checksum.h"
#include "formats/src/package/text.h"

namespace figurine {

using layout::Header;

namespace {

Status check_header(const Header& header, uint64_t actual_bytes,
                    std::span<const std::byte> sealed) {
  if (header.magic != layout::kMagic) return corrupt("header.magic", "not a figurine package");
  if (header.header_checksum != xxh3_64(sealed))
    return corrupt("header.header_checksum", "the header is damaged");
  if (header.version != kPackageVersion) {
    return unsupported("header.version", "is ", header.version, ", this build reads version ",
                       kPackageVersion);
  }
  if (const uint64_t unknown = header.required_features & ~layout::kKnownRequiredFeatures;
      unknown != 0) {
    return unsupported("header.required_features",
                       "needs features that this build does not know, as a bit field: ", unknown);
  }
  if (header.kind < uint32_t(PackageKind::kBody) || header.kind > uint32_t(PackageKind::kSampler)) {
    return unsupported(
        "header.kind", "is ", header.kind,
        ", this build knows 1 (body), 2 (avatar), 3 (motion), 4 (population), 5 (sampler)");
  }
  if (header.file_bytes != actual_bytes) {
    return corrupt("header.file_bytes", "the file has ", actual_bytes, " bytes, its header says ",
                   header.file_bytes);
  }
  if (header.index_offset != kPackageHeaderBytes)
    return corrupt("header.index_offset", "the index does not follow the header");
  if (header.index_bytes > layout::kMaxIndexBytes) {
    return over_limit("header.index_bytes", "the index is larger than ", layout::kMaxIndexBytes,
                      " bytes");
  }
  if (header.index_bytes == 0 || header.index_bytes > actual_bytes - kPackageHeaderBytes) {
    return corrupt("header.index_bytes", "the index reaches past the end of the file");
  }
  return {};
}

Status check_zero(std::span<const std::byte> bytes, uint64_t begin, uint64_t end,
                  const std::string& after) {
  for (uint64_t i = begin; i < end; ++i) {
    if (bytes[i] != std::byte{0})
      return corrupt("padding", "the bytes after ", after, " are not zero");
  }
  return {};
}

// Product of the shape's lengths and the element size, refusing zero lengths and overflow.
Status checked_size(const TensorInfo& info, uint64_t& out) {
  out = size_bytes(info.type);
  for (uint32_t length : info.shape) {
    if (length == 0) return corrupt(info.name, "the shape has a length of zero");
    if (out > std::numeric_limits<uint64_t>::max() / length)
      return corrupt(info.name, "the shape overflows 64 bits");
    out *= length;
  }
  return {};
}

// What lies in front of a blob. Its padding is looked at where its own last bytes are: on the same
// page, so that nothing is paged in for it.
struct Before {
  std::string name = "the index";
  uint64_t end = 0;
  bool wanted = true;
};

// One blob of the index; it is what lies before the next.
Status read_blob(const schema::Blob& entry, std::span<const std::byte> bytes,
                 const WantedParts& wanted, Before& before, BlobView& blob) {
  const std::string_view name = entry.name()->string_view();
  if (name.size() > layout::kMaxBlobNameBytes || !is_blob_name(name))
    return corrupt("index.blobs", "a blob's name is not [a-z0-9_.]{1,64}");
  blob.info.name = name;
  blob.optional = entry.optional();
  if (entry.type() > schema::ElementType::MAX) {
    return unsupported(blob.info.name, "element type ", int(entry.type()), " is unknown");
  }
  blob.info.type = static_cast<DataType>(entry.type());
  if (entry.shape()->size() < 1 || entry.shape()->size() > layout::kMaxRank)
    return corrupt(name, "the shape does not have 1 to 8 lengths");
  blob.info.shape.assign(entry.shape()->begin(), entry.shape()->end());
  uint64_t expected_bytes = 0;
  FIG_RETURN_IF_ERROR(checked_size(blob.info, expected_bytes));
  const schema::Extent& extent = *entry.extent();
  blob.info.offset_bytes = extent.offset();
  blob.info.size_bytes = extent.size();
  blob.info.checksum = extent.checksum();
  if (extent.size() != expected_bytes) {
    return corrupt(name, "shape and type make ", expected_bytes, " bytes, the index says ",
                   extent.size());
  }
  if (extent.offset() % kBlobAlignment != 0)
    return corrupt(name, "does not lie at a multiple of 64 bytes");
  if (extent.offset() > bytes.size() || extent.size() > bytes.size() - extent.offset())
    return corrupt(name, "reaches past the end of the file");
  if (extent.offset() < before.end) return corrupt(name, "overlaps ", before.name);
  if (extent.offset() > layout::align_up(before.end))
    return corrupt(name, "leaves a gap after ", before.name);
  if (before.wanted)
    FIG_RETURN_IF_ERROR(check_zero(bytes, before.end, extent.offset(), before.name));
  blob.bytes = bytes.subspan(extent.offset(), extent.size());
  blob.info.wanted = wanted.holds(name);
  if (blob.info.wanted && extent.checksum() != xxh3_64(blob.bytes))
    return corrupt(name, "checksum does not match, the blob is damaged");
  before = {blob.info.name, extent.offset() + extent.size(), blob.info.wanted};
  return {};
}

}  // namespace

WantedParts WantedParts::of(const OpenOptions& options, const schema::Index& index) {
  WantedParts wanted;
  wanted.mesh_places = options.mesh_places;
  const schema::Avatar* avatar = index.content_as_Avatar();
  if (avatar == nullptr) return wanted;
  wanted.golden_picture = options.golden_picture;
  wanted.pose_statistics = options.pose_statistics;
  const bool has_fixed_point = avatar->fixed_point() != nullptr;
  bool has_floats = false;
  for (const schema::Blob* blob : *index.blobs())
    has_floats = has_floats || blob->name()->string_view().starts_with("network.");
  if (has_fixed_point && has_floats && options.precision) {
    wanted.float_weights = *options.precision == Precision::kFloat32;
    wanted.fixed_point = !wanted.float_weights;
  }
  return wanted;
}

bool WantedParts::holds(std::string_view name) const {
  if (name.starts_with("network.")) return float_weights;
  if (name.starts_with("fixed.")) return fixed_point;
  if (name == "golden.png") return golden_picture;
  if (name == "pose.mean" || name == "pose.covariance" || name == "pose.distances")
    return pose_statistics;
  if (name == "body.texel_triangle" || name == "body.texel_barycentric") return mesh_places;
  return true;
}

Result<Container> open_index(std::span<const std::byte> bytes) {
  if (reinterpret_cast<uintptr_t>(bytes.data()) % kBlobAlignment != 0) {
    return Status(StatusCode::kInvalidArgument,
                  "the package's bytes are not 64-byte aligned in memory");
  }
  if (bytes.size() < kPackageHeaderBytes) {
    return corrupt("header", "the file has ", bytes.size(), " bytes, a package has at least 64");
  }
  Container container;
  std::memcpy(&container.header, bytes.data(), sizeof(Header));
  const Header& header = container.header;
  FIG_RETURN_IF_ERROR(check_header(header, bytes.size(), bytes.first(layout::kSealedHeaderBytes)));

  const std::span<const std::byte> index = bytes.subspan(header.index_offset, header.index_bytes);
  if (header.index_checksum != xxh3_64(index))
    return corrupt("header.index_checksum", "the index is damaged");
  const flatbuffers::Verifier::Options limits{.max_depth = layout::kMaxIndexDepth,
                                              .max_tables = layout::kMaxIndexTables};
  flatbuffers::Verifier verifier(reinterpret_cast<const uint8_t*>(index.data()), index.size(),
                                 limits);
  if (!schema::VerifyIndexBuffer(verifier))
    return corrupt("index", "not a sound flatbuffer, or beyond the limits of depth and tables");
  container.index = schema::GetIndex(index.data());
  if (uint32_t(container.index->content_type()) != header.kind)
    return corrupt("index.content", "is not of the header's kind");
  container.content_hash = xxh3_128(bytes.first(size_t{header.index_offset} + header.index_bytes));

  return container;
}

Result<Container> open_blobs(const Container& indexed, std::span<const std::byte> bytes,
                             const OpenOptions& options) {
  Result<Container> opened = indexed;
  Container& container = *opened;
  container.wanted = WantedParts::of(options, *container.index);
  const auto& entries = *container.index->blobs();
  if (entries.size() > layout::kMaxBlobs)
    return over_limit("index.blobs", "more than ", layout::kMaxBlobs);
  container.blobs.resize(entries.size());
  Before before{.end = uint64_t{container.header.index_offset} + container.header.index_bytes};
  std::set<std::string_view> names;
  for (uint32_t i = 0; i < entries.size(); ++i) {
    FIG_RETURN_IF_ERROR(
        read_blob(*entries.Get(i), bytes, container.wanted, before, container.blobs[i]));
    if (!names.insert(container.blobs[i].info.name).second)
      return corrupt(before.name, "is there twice");
  }
  if (bytes.size() != layout::align_up(before.end))
    return corrupt("header.file_bytes", "the file does not end after ", before.name);
  if (before.wanted) FIG_RETURN_IF_ERROR(check_zero(bytes, before.end, bytes.size(), before.name));
  return opened;
}

BlobReader::BlobReader(const Container& container) : wanted_(container.wanted) {
  for (const BlobView& blob : container.blobs) entries_[blob.info.name] = {.blob = &blob};
}

Status BlobReader::find(std::string_view name, DataType type, std::initializer_list<uint32_t> shape,
                        Presence presence, const BlobView*& out) {
  out = nullptr;
  const auto entry = entries_.find(name);
  if (entry == entries_.end())
    return presence == kRequired ? corrupt(name, "is missing") : Status();
  const TensorInfo& info = entry->second.blob->info;
  if (info.type != type)
    return corrupt(name, "is ", to_string(info.type), ", not ", to_string(type));
  bool same = info.shape.size() == shape.size();
  for (size_t i = 0; same && i < shape.size(); ++i)
    same = shape.begin()[i] == kAny || shape.begin()[i] == info.shape[i];
  if (!same) {
    const auto describe = [](const auto& lengths) {
      std::string text;
      for (uint32_t length : lengths)
        text += concatenate({text.empty() ? "" : ",", length == kAny ? Word("any") : Word(length)});
      return "[" + text + "]";
    };
    return corrupt(name, "has shape ", describe(info.shape), ", expected ", describe(shape));
  }
  entry->second.asked = true;
  if (info.wanted) out = entry->second.blob;
  return {};
}

template <class T>
Status BlobReader::read(std::string_view name, std::initializer_list<uint32_t> shape,
                        std::span<const T>& out, Presence presence) {
  constexpr DataType kType = std::is_same_v<T, float>     ? DataType::kF32
                             : std::is_same_v<T, uint8_t> ? DataType::kU8
                             : std::is_same_v<T, int8_t>  ? DataType::kI8
                             : std::is_same_v<T, int16_t> ? DataType::kI16
                             : std::is_same_v<T, int32_t> ? DataType::kI32
                             : std::is_same_v<T, Half>    ? DataType::kF16
                                                          : DataType::kU32;
  const BlobView* blob = nullptr;
  FIG_RETURN_IF_ERROR(find(name, kType, shape, presence, blob));
  if (blob != nullptr)
    out = {reinterpret_cast<const T*>(blob->bytes.data()), blob->bytes.size() / sizeof(T)};
  return {};
}

template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const float>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const uint8_t>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const int8_t>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const int16_t>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const int32_t>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const uint32_t>&, Presence);
template Status BlobReader::read(std::string_view, std::initializer_list<uint32_t>,
                                 std::span<const Half>&, Presence);

Status BlobReader::check_all_known() const {
  for (const auto& [name, entry] : entries_) {
    if (!entry.asked && !entry.blob->optional) {
      return unsupported(name, "this build does not know this blob, and it is not optional");
    }
  }
  return {};
}

}  // namespace figurine
