// Reads a .fgn package: 64-byte header, flatbuffer index, 64-byte-aligned blobs (docs/package.md;
// formats/schema/package.fbs is the manual of the index).
//
// Opening verifies in stages and always: size, magic, version, exact length, ranges, checksums
// (XXH3-64 of the index and of every blob), the flatbuffers Verifier with tight limits, then
// meaning (shapes x type = bytes, finite values, positive scales, parents before children, declared
// budgets). After that no access can fail, and views point into the caller's bytes: keep them
// mapped and unchanged while a view lives. What a use says that it does not want (OpenOptions) is
// neither verified nor there: its bytes are never read, so a memory map never pages them in.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/body.h"
#include "figurine/motion.h"
#include "figurine/population.h"
#include "figurine/sampler.h"
#include "figurine/status.h"

namespace figurine {

inline constexpr uint32_t kPackageVersion = 1;
inline constexpr size_t kPackageHeaderBytes = 64;
inline constexpr size_t kBlobAlignment = 64;

// Bits of the header's required features.
// An avatar's network is there in fixed point.
inline constexpr uint64_t kFeatureFixedPoint = uint64_t{1} << 0;
// A head's offsets have a bound (HeadDecoding::max_offset): who ignored it would draw other pixels.
inline constexpr uint64_t kFeatureBoundedOffsets = uint64_t{1} << 1;
// An avatar has a static part, or a network on a grid coarser than the texels, or no network.
inline constexpr uint64_t kFeatureStaticPart = uint64_t{1} << 2;
// An avatar has smallest extents, or is to be splatted antialiased, or both.
inline constexpr uint64_t kFeatureFilters = uint64_t{1} << 3;

// Bits of the header's optional features.
// There is a table of the training poses' distances (PoseStatistics::distances).
inline constexpr uint64_t kOptionalPoseDistances = uint64_t{1} << 0;

enum class PackageKind : uint8_t {
  kBody = 1,
  kAvatar = 2,
  kMotion = 3,
  kPopulation = 4,
  kSampler = 5
};
const char* to_string(PackageKind kind);

enum class DataType : uint8_t {
  kF32 = 0,
  kU8 = 1,
  kI16 = 2,
  kU32 = 3,
  kI8 = 4,
  kI32 = 5,
  kF16 = 6
};
const char* to_string(DataType type);
size_t size_bytes(DataType type);

// What a device needs to know before it loads.
struct Budget {
  uint64_t peak_memory_bytes =
      0;  // of the runtime for one instance, image and package excluded; 0: not applicable
  uint64_t macs_per_frame = 0;
  uint32_t gaussians = 0;
};

struct QualityMetric {
  std::string name;  // as in docs/results, e.g. psnr_pose_db
  double value = 0;
};

struct KeyValue {
  std::string key;
  std::string value;
};

// Where a package came from and what may be done with it. Licence and consent after VRM 1.0's meta.
struct Provenance {
  std::string tool;                  // "figurine-train 0.1.0"
  std::string created;               // ISO 8601 date, or empty for reproducible bytes
  std::vector<KeyValue> settings;    // command, seeds, training settings
  std::vector<std::string> sources;  // data: name, version, licence
  std::vector<QualityMetric> quality;
  std::string licence_name;
  std::string licence_url;
  std::vector<std::string> authors;
  std::string avatar_permission;  // who may perform: "onlyAuthor", "onlySeparatelyLicensedPerson",
                                  // "everyone"
  std::string commercial_usage;   // "personalNonProfit", "personalProfit", "corporation"
  std::string depicted_person;    // "synthetic", or how consent was given
};

// The texts of a provenance, of which a population's member may have its own.
inline constexpr std::string Provenance::* kProvenanceTexts[] = {
    &Provenance::tool,           &Provenance::created,           &Provenance::licence_name,
    &Provenance::licence_url,    &Provenance::avatar_permission, &Provenance::commercial_usage,
    &Provenance::depicted_person};

// A tensor of the index, for the inspector and for --diff.
struct TensorInfo {
  std::string name;
  DataType type = DataType::kF32;
  std::vector<uint32_t> shape;
  uint64_t offset_bytes = 0;
  uint64_t size_bytes = 0;
  uint64_t checksum = 0;
  bool wanted = true;  // false: OpenOptions left it out, its bytes were not looked at
};

// Which parts of a package a use wants; all of them unless said. Header and index are always read.
// What is left out is absent from the views (empty spans), as if the package had never had it, and
// damage in it stays unseen: who checks packages opens them whole (figurine-inspect does).
struct OpenOptions {
  // An avatar's weights in this precision alone, where the package holds them in both; it keeps
  // what it has where it holds one.
  std::optional<Precision> precision;
  bool golden_picture = true;   // the PNG of an avatar's golden frame
  bool pose_statistics = true;  // of an avatar
  bool mesh_places = true;      // Body::texel_triangle, texel_barycentric

  // What drawing takes. precision: that networks will run in. keep_to_known: frames may ask for
  // FrameAvatar::keep_to_known, or their caller for how unusual poses are.
  static OpenOptions for_drawing(std::optional<Precision> precision = Precision::kFixedPoint,
                                 bool keep_to_known = false) {
    return {.precision = precision,
            .golden_picture = false,
            .pose_statistics = keep_to_known,
            .mesh_places = false};
  }
};

// What header and index say of a package.
struct PackageIdentity {
  PackageKind kind = PackageKind::kBody;
  uint32_t version = 0;
  std::array<uint64_t, 2> content_hash{0, 0};  // Package::content_hash()
};

class Package {
 public:
  // bytes must be 64-byte aligned (a memory map or an aligned buffer is) and outlive the Package.
  // name appears in messages.
  static Result<Package> open(std::span<const std::byte> bytes, const std::string& name,
                              const OpenOptions& options = {});
  // By header and index alone, both verified; nothing else is read. Errors as of open() so far.
  static Result<PackageIdentity> identify(std::span<const std::byte> bytes,
                                          const std::string& name);

  Package(Package&&) noexcept;
  Package& operator=(Package&&) noexcept;
  ~Package();

  PackageKind kind() const;
  uint32_t version() const;
  uint64_t required_features() const;
  uint64_t optional_features() const;
  // XXH3-128 over header and index; the index holds every blob's checksum, so it names the whole
  // content. (low, high)
  std::array<uint64_t, 2> content_hash() const;

  const Body& body() const;              // kind must be kBody
  const Avatar& avatar() const;          // kind must be kAvatar
  const Motion& motion() const;          // kind must be kMotion
  const Population& population() const;  // kind must be kPopulation
  const Sampler& sampler() const;        // kind must be kSampler
  const Budget& budget() const;
  const Provenance& provenance() const;
  // Of a population's member: the package's, with what is the member's own, its quality among it.
  // kind must be kPopulation.
  Provenance member_provenance(size_t member) const;
  const std::vector<TensorInfo>& tensors() const;
  uint64_t size_bytes() const;
  uint64_t index_bytes() const;  // of the index alone

 private:
  struct Contents;
  explicit Package(std::unique_ptr<Contents> contents);
  std::unique_ptr<Contents> contents_;
};

std::string format_hash(const std::array<uint64_t, 2>& hash);  // 32 hex digits
// Of GoldenFrame::fixed_point_hash: XXH3-128 (low, high) of RGBA8 rows without gaps.
std::array<uint64_t, 2> hash_picture(std::span<const uint8_t> rgba8);
// Of GoldenSeed::hash: XXH3-128 (low, high) of all that an avatar in fixed point is decided by: per
// convolution its weights, their scales and its biases as they lie in memory, then the shape
// coefficients, then of every static group its values and their scales.
std::array<uint64_t, 2> hash_weights(const FixedPointNetwork& fixed, std::span<const float> shape,
                                     const StaticPart& static_part = {});

// An avatar fits a body if the hash, the UV size, the cells of its static part, the number of its
// smallest extents, the shape count and the golden pose's joint count do. kMismatch names both
// hashes.
Status check_avatar_fits_body(const Avatar& avatar, const Package& body);
Status check_motion_fits_body(const Motion& motion, const Body& body);

}  // namespace figurine
