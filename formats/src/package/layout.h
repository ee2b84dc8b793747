// The byte layout of a .fgn package that reader and writer share (docs/package.md): the 64-byte
// header, the alignment rule, the limits.
//
// Magic, version and header checksum keep their places in every version, so that any reader can
// tell a damaged file from a newer one.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "figurine/package.h"

namespace figurine::layout {

static_assert(std::endian::native == std::endian::little,
              "packages are little-endian and read without conversion");

// A byte above 127, the name, both line ends and an end-of-file mark, as in PNG: damage by
// text-mode transfer shows at once.
inline constexpr std::array<uint8_t, 8> kMagic{0x8F, 'F', 'G', 'N', '\r', '\n', 0x1A, '\n'};

struct Header {
  std::array<uint8_t, 8> magic = kMagic;
  uint32_t version = kPackageVersion;
  uint32_t kind = 0;               // PackageKind
  uint64_t required_features = 0;  // bits that a reader must know to read the package at all
  uint64_t optional_features = 0;  // bits that a reader may ignore
  uint64_t file_bytes = 0;         // the whole file, header included
  uint32_t index_offset = kPackageHeaderBytes;
  uint32_t index_bytes = 0;
  uint64_t index_checksum = 0;   // XXH3-64 of the index
  uint64_t header_checksum = 0;  // XXH3-64 of the 56 bytes before it
};
static_assert(sizeof(Header) == kPackageHeaderBytes && offsetof(Header, header_checksum) == 56);
inline constexpr size_t kSealedHeaderBytes = offsetof(Header, header_checksum);

inline constexpr uint64_t kKnownRequiredFeatures =
    kFeatureFixedPoint | kFeatureBoundedOffsets | kFeatureStaticPart | kFeatureFilters;

// Whether kFeatureStaticPart is set.
// Of an Avatar, a Population or a Sampler.
template <class Content>
bool needs_static_feature(const Content& content) {
  bool has_groups = false;
  if constexpr (requires { content.static_groups; }) {
    has_groups = !content.static_groups.empty();
  } else {
    has_groups = !content.static_part.empty();
  }
  return has_groups || content.texels_a_side() != content.network.input_size;
}

// Whether kFeatureFilters is set.
inline bool needs_filter_feature(const Avatar& avatar) {
  return !avatar.smallest_extents.empty() || avatar.antialiased;
}
inline bool needs_filter_feature(const Population& population) { return population.antialiased; }
inline bool needs_filter_feature(const Sampler& sampler) { return sampler.antialiased; }

// The first multiple of the blob alignment at or after the offset. Offsets are below 2^63.
constexpr uint64_t align_up(uint64_t offset) {
  return (offset + (kBlobAlignment - 1)) / kBlobAlignment * kBlobAlignment;
}

// Limits. They bound what opening a hostile package can cost, and are far above what the project's
// own packages need.
inline constexpr uint32_t kMaxIndexBytes = 4u << 20;
inline constexpr uint32_t kMaxIndexTables = 4096;
inline constexpr uint32_t kMaxIndexDepth = 8;
inline constexpr uint32_t kMaxBlobs = 1024;
inline constexpr uint32_t kMaxRank = 8;
inline constexpr uint32_t kMaxNameBytes = 256;  // names, and the permission and licence words
inline constexpr uint32_t kMaxBlobNameBytes = 64;
inline constexpr uint32_t kMaxTextBytes = 4096;    // URLs, data sources, setting values
inline constexpr uint32_t kMaxListEntries = 1024;  // settings, sources, quality metrics, authors
inline constexpr uint64_t kMaxReadingBytes =
    64u << 20;  // that an index's texts and lists may take: a forged one repeats them
inline constexpr uint32_t kMaxFourierOctaves = 12;
inline constexpr uint64_t kMaxValueBytes = 1u << 30;  // of one activation of a network
inline constexpr float kMaxLengthM =
    1000;  // of a body; catches files in other units before they become infinities
inline constexpr float kMaxTranslationM = 1e6f;  // of a motion's root
inline constexpr float kMaxFramesPerSecond = 10000;
inline constexpr uint32_t kMaxReportBytes = 256u << 10;  // of a sampler's evaluation
// Of the floats of a sampler: no matrix's result and no sampled weight then leaves the range of a
// float. The largest are 4096 products of 4096 products of normalised values: (1e6 * 127 * 4096)^2
// * 65e6 = 2e31 of 3e38.
inline constexpr float kMaxSamplerValue = 1e6f;

}  // namespace figurine::layout
