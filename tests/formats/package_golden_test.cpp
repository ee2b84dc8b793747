// The committed packages of format version 1: today's writer makes the same bytes, today's reader
// reads them. If one of these fails after a change of writer or schema, files in the field are at
// stake: read docs/package.md ("Evolution") before touching the golden files.
//
// FIGURINE_UPDATE_GOLDEN=1 package_test --gtest_filter='PackageGolden.*' writes them anew.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "formats/package_bytes.h"
#include "formats/package_samples.h"

namespace figurine::package_golden_test {
namespace {

using samples::SampleKind;
using Bytes = std::vector<std::byte>;

std::string golden_path(SampleKind kind) {
  return std::string(FIGURINE_SOURCE_DIR "/tests/golden/packages/") + samples::to_string(kind) +
         "_v1.fgn";
}

Bytes read_golden(SampleKind kind) {
  std::ifstream file(golden_path(kind), std::ios::binary);
  EXPECT_TRUE(file.good()) << golden_path(kind);
  const std::vector<char> chars{std::istreambuf_iterator<char>(file), {}};
  const auto* begin = reinterpret_cast<const std::byte*>(chars.data());
  return {begin, begin + chars.size()};
}

TEST(PackageGolden, TodaysWriterMakesTheGoldenBytes) {
  for (SampleKind kind : samples::kSampleKinds) {
    const Bytes bytes = *write_sample(kind);
    if (std::getenv("FIGURINE_UPDATE_GOLDEN") != nullptr) {
      std::ofstream(golden_path(kind), std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    }
    EXPECT_TRUE(bytes == read_golden(kind)) << golden_path(kind);
  }
}

TEST(PackageGolden, TodaysReaderReadsTheGoldenBytes) {
  // Content hashes by value: neither the files nor the hash may drift.
  const std::pair<SampleKind, const char*> expected[] = {
      {SampleKind::kBody, "8b8f9367898ad7d574f353e6b0b69ae7"},
      {SampleKind::kAvatar, "df4f0fdc16bf4abc2a392347c9560484"},
      {SampleKind::kFixedPointAvatar, "5f5e04dbda2fb6ac6e9152773c882959"},
      {SampleKind::kMotion, "4c9a33c1c2bc8e307e13fe60efd5964d"},
      {SampleKind::kPopulation, "07e8b960a4b16e5b3edda84e1d2b9838"},
      {SampleKind::kHalfPopulation, "9534fbbf8f780e60bf2c31480e6a566a"},
      {SampleKind::kSampler, "37c01096e6a65cd32cc813da0c34f7b8"},
      {SampleKind::kStaticAvatar, "d4f80846a7bbca94f4599dc86a079988"},
      {SampleKind::kStaticOnlyAvatar, "588a70e90250cc1c0e3a0ccdaa3903f2"},
      {SampleKind::kFilteredAvatar, "28ef19cd6a61e627ced1dfdcc1291923"},
      {SampleKind::kKnownPosesAvatar, "44c9e9fa99870d43fd2023fe1770e5a8"}};
  for (const auto& [kind, hash] : expected) {
    const samples::ExactBytes bytes(read_golden(kind));
    const Result<Package> package = Package::open(bytes.bytes(), golden_path(kind));
    ASSERT_TRUE(package.ok()) << package.status().message();
    EXPECT_EQ(package->kind(), package_kind(kind));
    EXPECT_EQ(format_hash(package->content_hash()), hash);
    std::string reason;
    EXPECT_TRUE(samples::exercise(*package, reason)) << reason;
  }
}

}  // namespace
}  // namespace figurine::package_golden_test
