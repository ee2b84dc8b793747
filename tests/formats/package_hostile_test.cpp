// The container against damage and malice: whatever is cut, flipped, appended, moved or newer is
// refused with a reason, and nothing outside the bytes is read.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>

#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/writer/package_parts.h"
#include "tests/emulated.h"

namespace figurine::package_hostile_test {
namespace {

using samples::ExactBytes;
using samples::get_header;
using samples::get_u64;
using samples::GuardedBytes;
using samples::MotionSample;
using samples::put_header;
using samples::put_u64;
using samples::SampleKind;
using samples::Seal;

using Bytes = std::vector<std::byte>;

constexpr size_t kStride = tests::stride_of_many(13);

Status open_status(std::span<const std::byte> bytes) {
  const ExactBytes exact(bytes);
  return Package::open(exact.bytes(), "hostile.fgn").status();
}

// Every refusal is one line that names the file, and has the expected code and words.
void expect_refused(const Status& status, StatusCode code, const std::string& words) {
  EXPECT_STREQ(to_string(status.code()), to_string(code)) << status.message();
  EXPECT_EQ(status.message().rfind("hostile.fgn: ", 0), 0u) << status.message();
  EXPECT_NE(status.message().find(words), std::string::npos)
      << status.message() << " should mention: " << words;
  EXPECT_EQ(status.message().find('\n'), std::string::npos) << status.message();
}

class PackageOpen : public testing::TestWithParam<SampleKind> {
 protected:
  Bytes sound() const { return *write_sample(GetParam()); }
};

INSTANTIATE_TEST_SUITE_P(EachKind, PackageOpen, testing::ValuesIn(samples::kSampleKinds),
                         [](const auto& kind) { return samples::to_string(kind.param); });

TEST_P(PackageOpen, RejectsEveryPrefix) {
  const Bytes bytes = sound();
  for (size_t length = 0; length < bytes.size(); length += kStride) {
    ASSERT_EQ(open_status(std::span(bytes).first(length)).code(), StatusCode::kCorrupt)
        << length << " of " << bytes.size() << " bytes";
  }
  EXPECT_TRUE(open_status(bytes).ok());
}

TEST_P(PackageOpen, RejectsEveryPrefixWithALengthToMatch) {
  const Bytes bytes = sound();
  const Seal seal(bytes);
  for (size_t length = kPackageHeaderBytes; length < bytes.size(); length += kStride) {
    Bytes cut(bytes.begin(), bytes.begin() + ptrdiff_t(length));
    layout::Header header = get_header(cut);
    header.file_bytes = length;
    put_header(cut, header);
    seal.renew(cut);
    ASSERT_EQ(open_status(cut).code(), StatusCode::kCorrupt)
        << length << " of " << bytes.size() << " bytes";
  }
}

TEST_P(PackageOpen, RejectsEveryFlippedBit) {
  Bytes bytes = sound();
  for (size_t i = 0; i < bytes.size(); i += kStride) {
    for (int bit = 0; bit < 8; ++bit) {
      // All bits of header and index, one of each byte behind them.
      if (i >= kPackageHeaderBytes + get_header(bytes).index_bytes && bit != int(i % 8)) continue;
      const std::byte flip{static_cast<uint8_t>(1u << bit)};
      bytes[i] ^= flip;
      ASSERT_EQ(open_status(bytes).code(), StatusCode::kCorrupt)
          << "bit " << bit << " of byte " << i;
      bytes[i] ^= flip;
    }
  }
}

TEST_P(PackageOpen, RejectsExtraBytes) {
  for (size_t extra : {1, 63, 64, 4096}) {
    Bytes bytes = sound();
    bytes.resize(bytes.size() + extra);
    expect_refused(open_status(bytes), StatusCode::kCorrupt, "header.file_bytes");
    layout::Header header = get_header(bytes);
    header.file_bytes = bytes.size();
    put_header(bytes, header);
    expect_refused(open_status(bytes), StatusCode::kCorrupt, "does not end after");
  }
}

TEST_P(PackageOpen, RejectsOtherVersions) {
  for (uint32_t version : {0u, 2u, 0x01000000u, UINT32_MAX}) {
    Bytes bytes = sound();
    layout::Header header = get_header(bytes);
    header.version = version;
    put_header(bytes, header);
    expect_refused(open_status(bytes), StatusCode::kUnsupported, "header.version");
  }
}

TEST_P(PackageOpen, RejectsEachUnknownRequiredFeatureAndIgnoresOptionalOnes) {
  const uint64_t own = get_header(sound()).required_features;
  for (int bit = 0; bit < 64; ++bit) {
    Bytes bytes = sound();
    layout::Header header = get_header(bytes);
    header.required_features = own ^ uint64_t { 1 } << bit;
    put_header(bytes, header);
    const bool known =
        (layout::kKnownRequiredFeatures >> bit & 1) != 0;  // and not what the package holds
    expect_refused(open_status(bytes), known ? StatusCode::kCorrupt : StatusCode::kUnsupported,
                   "header.required_features");
    header.required_features = own;
    header.optional_features = uint64_t{1} << bit;
    put_header(bytes, header);
    EXPECT_TRUE(open_status(bytes).ok()) << bit;
  }
}

TEST_P(PackageOpen, RejectsOtherKinds) {
  const uint32_t own = uint32_t(samples::package_kind(GetParam()));
  for (uint32_t kind : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, UINT32_MAX}) {
    Bytes bytes = sound();
    layout::Header header = get_header(bytes);
    header.kind = kind;
    put_header(bytes, header);
    if (kind == own) {
      EXPECT_TRUE(open_status(bytes).ok());
    } else if (kind >= 1 && kind <= 5) {
      expect_refused(open_status(bytes), StatusCode::kCorrupt, "index.content");
    } else {
      expect_refused(open_status(bytes), StatusCode::kUnsupported, "header.kind");
    }
  }
}

TEST_P(PackageOpen, RejectsIndexOutOfPlace) {
  const Bytes bytes = sound();
  const auto with = [&](uint32_t offset, uint32_t size) {
    Bytes changed = bytes;
    layout::Header header = get_header(changed);
    header.index_offset = offset;
    header.index_bytes = size;
    put_header(changed, header);
    return open_status(changed);
  };
  const uint32_t size = get_header(bytes).index_bytes;
  expect_refused(with(0, size), StatusCode::kCorrupt, "header.index_offset");
  expect_refused(with(128, size), StatusCode::kCorrupt, "header.index_offset");
  expect_refused(with(64, 0), StatusCode::kCorrupt, "header.index_bytes");
  expect_refused(with(64, static_cast<uint32_t>(bytes.size()) - 63), StatusCode::kCorrupt,
                 "header.index_bytes");
  expect_refused(with(64, UINT32_MAX), StatusCode::kLimitExceeded, "header.index_bytes");
  expect_refused(with(64, size - 1), StatusCode::kCorrupt, "header.index_checksum");
}

TEST_P(PackageOpen, RejectsBlobsPastTheEndOverlappingOrApart) {
  const Bytes bytes = sound();
  const Seal seal(bytes);
  const auto with = [&](size_t blob, uint64_t offset) {
    Bytes changed = bytes;
    put_u64(changed, seal.extent_at(blob), offset);
    seal.renew(changed);
    return open_status(changed);
  };
  for (size_t blob = 0; blob < seal.blob_count(); ++blob) {
    const uint64_t offset = get_u64(bytes, seal.extent_at(blob));
    expect_refused(with(blob, layout::align_up(bytes.size())), StatusCode::kCorrupt,
                   "past the end");
    expect_refused(with(blob, uint64_t{0} - 64), StatusCode::kCorrupt, "past the end");
    expect_refused(with(blob, uint64_t{1} << 63), StatusCode::kCorrupt, "past the end");
    expect_refused(with(blob, offset + 4), StatusCode::kCorrupt, "multiple of 64");
    expect_refused(with(blob, 0), StatusCode::kCorrupt, "overlaps");
    expect_refused(with(blob, offset - 64), StatusCode::kCorrupt, "overlaps");
    if (blob + 1 < seal.blob_count()) {
      const uint64_t size = get_u64(bytes, seal.extent_at(blob) + 8);
      if (offset + 64 + size <= bytes.size())
        expect_refused(with(blob, offset + 64), StatusCode::kCorrupt, "leaves a gap");
    }
    Bytes changed = bytes;
    put_u64(changed, seal.extent_at(blob) + 8, get_u64(changed, seal.extent_at(blob) + 8) + 4);
    seal.renew(changed);
    expect_refused(open_status(changed), StatusCode::kCorrupt, "shape and type make");
  }
}

TEST_P(PackageOpen, RejectsEveryPaddingByteThatIsNotZero) {
  Bytes bytes = sound();
  const Seal seal(bytes);
  std::vector<bool> padding(bytes.size(), true);
  const auto mark = [&](uint64_t begin, uint64_t size) {
    std::fill_n(padding.begin() + ptrdiff_t(begin), size, false);
  };
  mark(0, kPackageHeaderBytes + get_header(bytes).index_bytes);
  for (size_t i = 0; i < seal.blob_count(); ++i)
    mark(get_u64(bytes, seal.extent_at(i)), get_u64(bytes, seal.extent_at(i) + 8));
  size_t checked = 0;
  for (size_t i = 0; i < bytes.size(); ++i) {
    if (!padding[i]) continue;
    bytes[i] = std::byte{1};
    expect_refused(open_status(bytes), StatusCode::kCorrupt, "padding");
    bytes[i] = std::byte{0};
    ++checked;
  }
  EXPECT_GT(checked, 0u);
}

TEST_P(PackageOpen, ReadsNothingOutsideTheBytes) {
  const Bytes bytes = sound();
  const GuardedBytes guarded(bytes.size());
  std::memcpy(guarded.bytes(bytes.size()).data(), bytes.data(), bytes.size());
  const Result<Package> package = Package::open(guarded.bytes(bytes.size()), "guarded.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  std::string reason;
  EXPECT_TRUE(samples::exercise(*package, reason)) << reason;
  for (size_t length = 0; length < bytes.size(); length += kBlobAlignment) {
    std::memcpy(guarded.bytes(length).data(), bytes.data(), length);
    EXPECT_FALSE(Package::open(guarded.bytes(length), "guarded.fgn").ok());
  }
}

TEST_P(PackageOpen, RejectsMisalignedMemory) {
  const Bytes bytes = sound();
  std::vector<std::byte> storage(bytes.size() + 2 * kBlobAlignment);
  const AlignedBytes aligned(storage);
  for (size_t shift : {1, 4, 8, 16, 32}) {
    std::byte* start = const_cast<std::byte*>(aligned.bytes().data()) + shift;
    std::memcpy(start, bytes.data(), bytes.size());
    expect_refused(Package::open({start, bytes.size()}, "hostile.fgn").status(),
                   StatusCode::kInvalidArgument, "64-byte aligned");
  }
}

// ---- The blob list ------------------------------------------------------------------------------

Status open_parts(const std::function<void(PackageParts&)>& bend) {
  const MotionSample sample;
  PackageParts parts = *take_apart(sample.motion, samples::make_provenance());
  bend(parts);
  return open_status(assemble(parts));
}

BlobPart extra_blob(const std::string& name, bool optional) {
  static const uint32_t kValues[3] = {1, 2, 3};
  return {.name = name,
          .type = DataType::kU32,
          .shape = {3},
          .bytes = std::as_bytes(std::span(kValues)),
          .optional = optional};
}

TEST(PackageBlobs, SkipsUnknownOptionalBlobsAnywhere) {
  const MotionSample sample;
  for (size_t place = 0; place <= 2; ++place) {
    PackageParts parts = *take_apart(sample.motion, samples::make_provenance());
    parts.blobs.insert(parts.blobs.begin() + ptrdiff_t(place), extra_blob("motion.contacts", true));
    const ExactBytes bytes(assemble(parts));
    const Result<Package> package = Package::open(bytes.bytes(), "future.fgn");
    ASSERT_TRUE(package.ok()) << package.status().message();
    EXPECT_EQ(package->tensors().size(), 3u);
    EXPECT_EQ(package->tensors()[place].name, "motion.contacts");
    EXPECT_TRUE(std::equal(sample.rotations.begin(), sample.rotations.end(),
                           package->motion().rotations.begin()));
  }
}

TEST(PackageBlobs, RejectsUnknownBlobsThatAreNotOptional) {
  expect_refused(open_parts([](PackageParts& parts) {
                   parts.blobs.push_back(extra_blob("motion.contacts", false));
                 }),
                 StatusCode::kUnsupported, "motion.contacts");
}

TEST(PackageBlobs, RejectsMissingTwiceAndMisnamed) {
  expect_refused(open_parts([](PackageParts& parts) { parts.blobs.pop_back(); }),
                 StatusCode::kCorrupt, "motion.rotations: is missing");
  expect_refused(open_parts([](PackageParts& parts) { parts.blobs.clear(); }), StatusCode::kCorrupt,
                 "is missing");
  expect_refused(open_parts([](PackageParts& parts) { parts.blobs.push_back(parts.blobs[0]); }),
                 StatusCode::kCorrupt, "twice");
  for (const std::string& name : {std::string(), std::string("Motion"), std::string("a b"),
                                  std::string("x\ny"), std::string(65, 'a')}) {
    expect_refused(
        open_parts([&](PackageParts& parts) { parts.blobs.push_back(extra_blob(name, true)); }),
        StatusCode::kCorrupt, "index.blobs");
  }
}

TEST(PackageBlobs, RejectsShapesThatOverflowAreEmptyOrDoNotFit) {
  const auto with_shape = [](const std::vector<uint32_t>& shape) {
    return open_parts([&](PackageParts& parts) {
      parts.blobs.push_back(extra_blob("future", true));
      parts.blobs.back().shape = shape;
    });
  };
  EXPECT_TRUE(with_shape({3}).ok());
  EXPECT_TRUE(with_shape({1, 1, 3, 1, 1, 1, 1, 1}).ok());
  expect_refused(with_shape({}), StatusCode::kCorrupt, "1 to 8 lengths");
  expect_refused(with_shape({1, 1, 3, 1, 1, 1, 1, 1, 1}), StatusCode::kCorrupt, "1 to 8 lengths");
  expect_refused(with_shape({3, 0}), StatusCode::kCorrupt, "length of zero");
  expect_refused(with_shape({4}), StatusCode::kCorrupt, "shape and type make 16 bytes");
  expect_refused(with_shape({1u << 31, 1u << 31, 1}), StatusCode::kCorrupt,
                 "overflows");  // 2^62 x 4 = 2^64: zero in 64 bits
  expect_refused(with_shape({1u << 31, 1u << 31, 2}), StatusCode::kCorrupt,
                 "overflows");  // 2^63 before the element size
  expect_refused(with_shape({0x40000001u, 0x80000000u, 6}), StatusCode::kCorrupt,
                 "overflows");  // wraps to a small number
  expect_refused(with_shape({UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX}), StatusCode::kCorrupt,
                 "overflows");
  expect_refused(with_shape({1u << 30}), StatusCode::kCorrupt,
                 "shape and type make 4294967296 bytes");
}

TEST(PackageBlobs, RejectsOtherShapesAndTypesOfKnownBlobs) {
  const auto with = [](const std::vector<uint32_t>& shape, DataType type) {
    return open_parts([&](PackageParts& parts) {
      parts.blobs[1].shape = shape;
      parts.blobs[1].type = type;
    });
  };
  EXPECT_TRUE(with({3, 2, 4}, DataType::kF32).ok());
  expect_refused(with({3, 8}, DataType::kF32), StatusCode::kCorrupt,
                 "motion.rotations: has shape [3,8], expected [3,2,4]");
  expect_refused(with({2, 3, 4}, DataType::kF32), StatusCode::kCorrupt,
                 "motion.rotations: has shape");
  expect_refused(with({3, 2, 4}, DataType::kU32), StatusCode::kCorrupt,
                 "motion.rotations: is u32, not f32");
  expect_refused(with({3, 2, 4}, static_cast<DataType>(7)), StatusCode::kUnsupported,
                 "element type 7 is unknown");
}

TEST(PackageLimits, RejectsIndicesThatCostTooMuch) {
  const auto with_settings = [](size_t count, size_t bytes) {
    return open_parts([&](PackageParts& parts) {
      parts.provenance.settings.assign(count, {"key", std::string(bytes, 'x')});
    });
  };
  EXPECT_TRUE(with_settings(1000, 4000).ok());
  expect_refused(with_settings(1025, 1), StatusCode::kLimitExceeded, "provenance.settings");
  expect_refused(with_settings(1, 4097), StatusCode::kLimitExceeded,
                 "provenance.settings[0].value");
  expect_refused(with_settings(5000, 1), StatusCode::kCorrupt, "limits of depth and tables");
  expect_refused(with_settings(1024, 4096), StatusCode::kLimitExceeded, "header.index_bytes");
  expect_refused(open_parts([](PackageParts& parts) {
                   for (int i = 0; i < 1100; ++i)
                     parts.blobs.push_back(extra_blob("future." + std::to_string(i), true));
                 }),
                 StatusCode::kLimitExceeded, "index.blobs");
}

// An index of 240 kB in which every source is one text, as long as all of them together: read, it
// would be 400 MB of strings.
TEST(PackageLimits, RejectsAnIndexThatSaysOneLongTextAThousandTimes) {
  const MotionSample sample;
  Provenance provenance = samples::make_provenance();
  provenance.sources.assign(layout::kMaxListEntries, std::string(200, 'x'));
  Bytes bytes = *write_package(sample.motion, provenance);
  const Seal seal(bytes);
  ASSERT_TRUE(open_status(bytes).ok());
  const auto u32_at = [&](size_t at) {
    uint32_t value = 0;
    std::memcpy(&value, &bytes[at], 4);
    return value;
  };
  // A list is its length and the distances of its texts, which lie behind it: length, bytes, zero.
  const layout::Header header = get_header(bytes);
  const size_t begin = header.index_offset, end = begin + header.index_bytes;
  size_t first = 0, last = 0, list = 0;
  for (size_t at = begin; at + 205 <= end; at += 4) {
    if (u32_at(at) != 200 || u32_at(at + 4) != 0x78787878) continue;
    if (first == 0) first = at;
    last = at;
  }
  for (size_t at = begin; at < first && list == 0; at += 4) {
    const size_t text = at + 4 + u32_at(at + 4);
    if (u32_at(at) == layout::kMaxListEntries && text >= first && text <= last) list = at;
  }
  ASSERT_GT(list, 0u);
  for (size_t entry = list + 4; entry < list + 4 + 4 * size_t{layout::kMaxListEntries};
       entry += 4) {
    const auto distance = static_cast<uint32_t>(first - entry);
    std::memcpy(&bytes[entry], &distance, 4);
  }
  const auto length = static_cast<uint32_t>(last + 200 - first);
  std::memcpy(&bytes[first], &length, 4);
  seal.renew(bytes);
  expect_refused(open_status(bytes), StatusCode::kLimitExceeded, "index: its texts and lists take");
}

}  // namespace
}  // namespace figurine::package_hostile_test
