// .spz of every version: bytes packed here, read against values worked out here; and headers that
// promise more than there is.
#include "ports/gaussians/spz.h"

#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <cmath>
#include <cstring>
#include <random>

#include "ports/gaussians/gaussian_file.h"

namespace figurine::ports::spz_test {
namespace {

template <class T>
void add(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string gzip(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 1, Z_DEFLATED, 16 + MAX_WBITS, 9, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

std::string zstd(const std::string& text) {
  std::string packed(ZSTD_compressBound(text.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), text.data(), text.size(), 3));
  return packed;
}

// Two Gaussians; the streams in the file's order.
struct Spz {
  uint32_t version = 3, count = 2;
  uint8_t sh_degree = 1, fractional_bits = 12, flags = 0;
  std::vector<std::string> streams;
  std::string extensions;

  explicit Spz(uint32_t of_version) : version(of_version) {
    std::string positions, rotations;
    for (const double metres : {1.0, -2.5, 0.25, 50.0, -1000.0, 0.0}) {
      if (version == 1) {
        constexpr std::pair<double, uint16_t> kHalves[] = {
            {1, 0x3C00}, {-2.5, 0xC100}, {0.25, 0x3400}, {50, 0x5240}, {-1000, 0xE3D0}, {0, 0}};
        for (const auto& [value, bits] : kHalves) {
          if (value == metres) add(positions, bits);
        }
      } else {
        add(positions, static_cast<int32_t>(metres * 4096));
        positions.pop_back();  // 24 bits
      }
    }
    if (version < 3) {
      rotations = std::string("\xFF\x80\x80", 3) + "\x80\x80\x80";  // half a turn about x; none
    } else {
      add(rotations, uint32_t{0u << 30 | 0u});                   // x is one
      add(rotations, uint32_t{3u << 30 | (512u | 511u) << 20});  // w and -x, 45 degrees each
    }
    streams = {positions,
               std::string("\xFF\x33", 2),
               std::string("\x80\x00\xFF\x00\x80\x33", 6),
               std::string("\xA0\x90\x80\x70\x60\x50", 6),
               rotations,
               std::string("\x80\x00\xFF\x81\x82\x83\x84\x85\x86", 9) + std::string(9, '\x80')};
  }

  std::string header() const {
    std::string bytes = "NGSP";
    add(bytes, version);
    add(bytes, count);
    for (const uint8_t byte : {sh_degree, fractional_bits, flags}) add(bytes, byte);
    return bytes;
  }

  // Versions 1 to 3, before gzip.
  std::string bare() const {
    std::string bytes = header() + '\0';
    for (const std::string& stream : streams) bytes += stream;
    return bytes + extensions;
  }

  std::string bytes() const {
    if (version < 4) return gzip(bare());
    std::string text = header();
    add(text, static_cast<uint8_t>(streams.size()));
    add(text, static_cast<uint32_t>(32 + extensions.size()));
    text += std::string(12, '\0') + extensions;
    std::string packed;
    for (const std::string& stream : streams) {
      const std::string one = zstd(stream);
      add(text, uint64_t{one.size()});
      add(text, uint64_t{stream.size()});
      packed += one;
    }
    return text + packed;
  }
};

Result<GaussianCloud> read(const std::string& bytes) {
  return read_gaussians(std::as_bytes(std::span(bytes)), "x.spz");
}

void expect_refused(const std::string& bytes, const std::string& reason,
                    StatusCode code = StatusCode::kCorrupt) {
  const Result<GaussianCloud> cloud = read(bytes);
  ASSERT_FALSE(cloud.ok()) << reason;
  EXPECT_EQ(cloud.status().code(), code) << cloud.status().message();
  EXPECT_TRUE(cloud.status().message().starts_with("x.spz: spz: ")) << cloud.status().message();
  EXPECT_NE(cloud.status().message().find(reason), std::string::npos) << cloud.status().message();
}

void expect_the_two(const GaussianCloud& cloud) {
  ASSERT_EQ(cloud.count(), 2u);
  ASSERT_EQ(cloud.sh_degree, 1u);
  EXPECT_EQ(cloud.position_m, (std::vector<float>{1, -2.5f, 0.25f, 50, -1000, 0}));
  EXPECT_EQ(cloud.opacity[0], 1.0f);
  EXPECT_NEAR(cloud.opacity[1], 0.2, 1e-6);
  EXPECT_NEAR(cloud.sh[0], (128 / 255.0 - 0.5) / 0.15, 1e-6);
  EXPECT_NEAR(cloud.sh[1], -0.5 / 0.15, 1e-6);
  EXPECT_NEAR(cloud.sh[2], 0.5 / 0.15, 1e-6);
  const float first_band[9] = {0,          -1,         127 / 128.0f, 1 / 128.0f, 2 / 128.0f,
                               3 / 128.0f, 4 / 128.0f, 5 / 128.0f,   6 / 128.0f};
  for (size_t k = 0; k < 9; ++k) EXPECT_EQ(cloud.sh[3 + k], first_band[k]) << "colours innermost";
  // Half a turn about x: y and z turn round.
  EXPECT_NEAR(cloud.covariance_factor[0], std::exp(0), 2e-2);
  EXPECT_NEAR(cloud.covariance_factor[4], -std::exp(-1), 1e-2);
  EXPECT_NEAR(cloud.covariance_factor[8], -std::exp(-2), 1e-2);
}

TEST(Spz, ReadsVersionsOneToFour) {
  for (uint32_t version = 1; version <= 4; ++version) {
    SCOPED_TRACE(version);
    const Result<GaussianCloud> cloud = read(Spz(version).bytes());
    ASSERT_TRUE(cloud.ok()) << cloud.status().message();
    EXPECT_EQ(cloud->container, "spz " + std::to_string(version));
    expect_the_two(*cloud);
    if (version < 3) {
      // x, y and z of the second are 128 / 127.5 - 1: nearly unrotated.
      EXPECT_NEAR(cloud->covariance_factor[9], std::exp(-3), 1e-3);
    } else {  // a quarter turn about -x: y goes to -z
      EXPECT_NEAR(cloud->covariance_factor[9 + 3 * 2 + 1], -std::exp(-4), 1e-4);
      EXPECT_NEAR(cloud->covariance_factor[9 + 3 * 1 + 2], std::exp(-5), 1e-4);
    }
    EXPECT_FALSE(cloud->antialiased);
    EXPECT_EQ(cloud->up, std::nullopt);
  }
}

TEST(Spz, ReadsOldOnesWithoutTheirPacking) {
  const Result<GaussianCloud> cloud = read(Spz(3).bare());
  ASSERT_TRUE(cloud.ok()) << cloud.status().message();
  expect_the_two(*cloud);
}

TEST(Spz, FlagsAndFractionalBits) {
  for (const uint32_t version : {2u, 4u}) {
    Spz file(version);
    file.flags = 1;
    file.fractional_bits = 10;
    const Result<GaussianCloud> cloud = read(file.bytes());
    ASSERT_TRUE(cloud.ok());
    EXPECT_TRUE(cloud->antialiased);
    EXPECT_EQ(cloud->position_m[0] + cloud->origin_m[0], 4.0);
  }
}

TEST(Spz, DegreeFourIsReadToDegreeThree) {
  Spz file(4);
  file.sh_degree = 4;
  file.streams[5].clear();
  for (int k = 0; k < 144; ++k) file.streams[5] += static_cast<char>(k);
  const Result<GaussianCloud> cloud = read(file.bytes());
  ASSERT_TRUE(cloud.ok()) << cloud.status().message();
  EXPECT_EQ(cloud->sh_degree, 3u);
  EXPECT_EQ(cloud->sh[3], -1.0f);
  EXPECT_EQ(cloud->sh[48 + 3], (72 - 128) / 128.0f) << "the second begins behind 72 values";
  ASSERT_EQ(cloud->remarks.size(), 1u);
  EXPECT_NE(cloud->remarks[0].find("degree 4"), std::string::npos);
}

TEST(Spz, DegreeZeroHasNoHarmonics) {
  for (const uint32_t version : {3u, 4u}) {
    Spz file(version);
    file.sh_degree = 0;
    file.streams.pop_back();
    const Result<GaussianCloud> cloud = read(file.bytes());
    ASSERT_TRUE(cloud.ok()) << cloud.status().message();
    EXPECT_EQ(cloud->sh.size(), 6u);
  }
}

// Records of a type, a length and a payload: which axes the data have is read, others are skipped.
TEST(Spz, ExtensionsSayWhatIsUp) {
  const auto read_axes = [](uint32_t version, uint32_t system) {
    Spz file(version);
    file.flags = 2;
    add(file.extensions, uint32_t{0xADBE0002});
    add(file.extensions, uint32_t{12});
    file.extensions += std::string(12, 'x');
    add(file.extensions, uint32_t{0xADBE0003});
    add(file.extensions, uint32_t{4});
    add(file.extensions, system);
    return read(file.bytes());
  };
  const std::pair<uint32_t, UpAxis> kRightHanded[] = {
      {1, UpAxis::kMinusY}, {4, UpAxis::kPlusY},  {6, UpAxis::kMinusY},  {7, UpAxis::kPlusY},
      {9, UpAxis::kMinusZ}, {12, UpAxis::kPlusZ}, {14, UpAxis::kMinusZ}, {15, UpAxis::kPlusZ}};
  for (const uint32_t version : {3u, 4u}) {
    for (const auto& [system, up] : kRightHanded) {
      const Result<GaussianCloud> cloud = read_axes(version, system);
      ASSERT_TRUE(cloud.ok()) << system << " " << cloud.status().message();
      EXPECT_EQ(cloud->up, up) << system;
      ASSERT_EQ(cloud->remarks.size(), 1u);
      EXPECT_EQ(cloud->remarks[0], "skipped 1 extensions");
    }
    for (const uint32_t system : {2u, 3u, 5u, 8u, 10u, 11u, 13u, 16u}) {
      const Result<GaussianCloud> cloud = read_axes(version, system);
      ASSERT_FALSE(cloud.ok()) << system;
      EXPECT_EQ(cloud.status().code(), StatusCode::kUnsupported);
      EXPECT_NE(cloud.status().message().find("left-handed axes ("), std::string::npos);
    }
    EXPECT_TRUE(read_axes(version, 0).ok());
    EXPECT_FALSE(read_axes(version, 17).ok());
  }
}

TEST(Spz, HeadersThatCannotBe) {
  Spz file(3);
  file.version = 5;
  expect_refused(file.bare(), "version 5; 1 to 4 are read", StatusCode::kUnsupported);
  expect_refused(gzip(file.bare()), "version 5", StatusCode::kUnsupported);
  file.version = 0;
  expect_refused(file.bare(), "version 0", StatusCode::kUnsupported);
  file = Spz(3);
  file.sh_degree = 5;
  expect_refused(file.bytes(), "degree 5", StatusCode::kUnsupported);
  file.sh_degree = 1;
  file.fractional_bits = 25;
  expect_refused(file.bytes(), "fractional bits");
  file = Spz(3);
  file.count = 3;
  expect_refused(file.bytes(), "declares 3 Gaussians: the gzip stream ends early");
  expect_refused(file.bare(), "declares 3 Gaussians, the data ends early");
  file.count = 1;  // the second lies where extensions would be
  EXPECT_TRUE(read(file.bytes()).ok());
  file.flags = 2;
  EXPECT_FALSE(read(file.bytes()).ok());
  expect_refused(gzip("something else than that"), "gzip, but of something else");
  expect_refused(gzip("short"), "the gzip stream ends early");
  expect_refused("NGSP", "shorter than its header");
  file = Spz(3);
  file.count = 0;
  EXPECT_FALSE(read(file.bytes()).ok());
}

// Judged by what they declare: nothing of that size is unpacked.
TEST(Spz, BombsAreRefusedBeforeTheyAreUnpacked) {
  for (const uint32_t count : {1000000u, 1u << 31, ~0u}) {
    Spz file(3);
    file.count = count;
    file.streams = {std::string(1 << 20, '\0')};
    expect_refused(file.bytes(), "in a file of", StatusCode::kLimitExceeded);
    file.version = 4;
    expect_refused(Spz(4).bytes().replace(8, 4, reinterpret_cast<const char*>(&count), 4),
                   "in a file of", StatusCode::kLimitExceeded);
  }
  Spz file(3);  // what is declared is small, and much more follows
  file.extensions = std::string(1 << 23, '\0');
  expect_refused(file.bytes(), "it goes on behind what it declares");
}

TEST(Spz, EveryPrefixIsRefused) {
  for (uint32_t version = 1; version <= 4; ++version) {
    const std::string bytes = Spz(version).bytes();
    for (size_t length = 0; length < bytes.size(); ++length)
      EXPECT_FALSE(read(bytes.substr(0, length)).ok()) << version << " " << length;
  }
}

TEST(Spz, TablesThatLie) {
  const std::string bytes = Spz(4).bytes();
  const auto with = [&](size_t at, uint64_t value, size_t size) {
    std::string text = bytes;
    std::memcpy(text.data() + at, &value, size);
    return text;
  };
  expect_refused(with(15, 5, 1), "5 streams, 6 belong to its degree");
  for (const uint64_t offset : {0ull, 31ull, 1ull << 31, ~0ull})
    expect_refused(with(16, offset, 4), "table of streams");
  for (const uint64_t size : {0ull, 17ull, 1ull << 40, ~0ull})
    expect_refused(with(32 + 8, size, 8), "stream 0 has");
  for (const uint64_t size : {1ull << 20, 1ull << 63, ~0ull})
    expect_refused(with(32, size, 8), "stream 0 ends behind the file");
  expect_refused(with(32, 3, 8), "stream 0 is damaged");
}

TEST(Spz, FlippedBytesStaySound) {
  std::mt19937 random(9);
  size_t accepted = 0;
  for (const uint32_t version : {2u, 3u, 4u}) {
    for (const bool packed : {false, true}) {
      const std::string bytes = packed || version == 4 ? Spz(version).bytes() : Spz(version).bare();
      for (int round = 0; round < 2000; ++round) {
        std::string broken = bytes;
        for (unsigned flips = 1 + random() % 3; flips > 0; --flips)
          broken[random() % broken.size()] ^= static_cast<char>(1u << random() % 8);
        const Result<GaussianCloud> cloud = read(broken);
        if (!cloud.ok()) continue;
        ++accepted;
        ASSERT_EQ(cloud->position_m.size(), 3 * size_t(cloud->count()));
        for (const float value : cloud->covariance_factor) ASSERT_TRUE(std::isfinite(value));
      }
    }
  }
  EXPECT_GT(accepted, 100u);
}

}  // namespace
}  // namespace figurine::ports::spz_test
