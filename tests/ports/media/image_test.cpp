// Image files: known bytes, round trips, and broken files.
#include "ports/media/image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "ports/media/pfm.h"
#include "ports/media/png.h"

namespace figurine::ports::image_test {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

ImageU8 random_image(uint32_t width, uint32_t height, uint32_t channels) {
  std::mt19937 random(width * 31 + height * 7 + channels);
  ImageU8 image(width, height, channels);
  for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(random());
  return image;
}

TEST(Png, RoundTripKeepsEveryPixel) {
  for (const uint32_t channels : {1u, 3u, 4u}) {
    for (const auto& [width, height] : {std::pair{1u, 1u}, {7u, 5u}, {64u, 33u}}) {
      const ImageU8 image = random_image(width, height, channels);
      const Result<std::vector<std::byte>> png = encode_png(image);
      ASSERT_TRUE(png.ok()) << png.status().message();
      const Result<ImageU8> back = decode_png(*png, "x.png");
      ASSERT_TRUE(back.ok()) << back.status().message();
      EXPECT_EQ(back->channels, channels);
      EXPECT_EQ(back->width_px, width);
      EXPECT_EQ(back->height_px, height);
      EXPECT_EQ(back->pixels, image.pixels) << "colours under alpha 0 included";
    }
  }
}

TEST(Png, TheSamePixelsGiveTheSameBytes) {
  const ImageU8 image = random_image(40, 30, 4);
  EXPECT_EQ(*encode_png(image), *encode_png(image));
}

TEST(Png, ReadsBytesMadeByHand) {
  // 2x1 RGB, red and blue: signature, IHDR, IDAT with a stored block, IEND. Checksums are worked
  // out here.
  std::vector<unsigned char> png = {0x89, 'P', 'N', 'G', 13, 10, 26, 10};
  const auto crc = [](const std::vector<unsigned char>& data) {
    uint32_t c = 0xffffffffu;
    for (const unsigned char byte : data) {
      c ^= byte;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320u ^ (c >> 1) : c >> 1;
    }
    return c ^ 0xffffffffu;
  };
  const auto chunk = [&](const char* type, const std::vector<unsigned char>& data) {
    std::vector<unsigned char> checked(type, type + 4);
    checked.insert(checked.end(), data.begin(), data.end());
    const auto put = [&](uint32_t value) {
      for (int shift = 24; shift >= 0; shift -= 8)
        png.push_back(static_cast<unsigned char>(value >> shift));
    };
    put(static_cast<uint32_t>(data.size()));
    png.insert(png.end(), checked.begin(), checked.end());
    put(crc(checked));
  };
  chunk("IHDR", {0, 0, 0, 2, 0, 0, 0, 1, 8, 2, 0, 0, 0});
  const std::vector<unsigned char> row = {0, 255, 0, 0, 0, 0, 255};
  uint32_t a = 1, b = 0;
  for (const unsigned char byte : row) a = (a + byte) % 65521, b = (b + a) % 65521;
  std::vector<unsigned char> stream = {0x78, 1, 1, 7, 0, 0xf8, 0xff};
  stream.insert(stream.end(), row.begin(), row.end());
  for (const uint32_t part : {b, a})
    stream.insert(stream.end(),
                  {static_cast<unsigned char>(part >> 8), static_cast<unsigned char>(part)});
  chunk("IDAT", stream);
  chunk("IEND", {});
  const Result<ImageU8> image = decode_png(std::as_bytes(std::span(png)), "x.png");
  ASSERT_TRUE(image.ok()) << image.status().message();
  EXPECT_EQ(image->pixels, (std::vector<uint8_t>{255, 0, 0, 0, 0, 255}));
}

TEST(Png, BrokenFilesAreErrors) {
  const std::vector<std::byte> png = *encode_png(random_image(20, 20, 3));
  EXPECT_FALSE(decode_png({}, "x.png").ok());
  for (size_t length = 0; length + 12 < png.size();
       length += 7) {  // the last chunk carries no pixels
    const Result<ImageU8> image = decode_png(std::span(png).first(length), "x.png");
    ASSERT_FALSE(image.ok()) << length;
    EXPECT_TRUE(image.status().message().starts_with("x.png: png: ")) << image.status().message();
  }
  std::vector<std::byte> huge = png;
  huge[16] = huge[20] = std::byte{0x00};
  huge[18] = huge[22] = std::byte{0x3f};  // 16148 pixels a side and a wrong checksum
  EXPECT_FALSE(decode_png(huge, "x.png").ok());
}

TEST(Png, UnsoundImagesAreRefused) {
  EXPECT_FALSE(encode_png(ImageU8{}).ok());
  EXPECT_FALSE(encode_png(ImageU8(2, 2, 2)).ok());
  ImageU8 image(2, 2, 3);
  image.pixels.pop_back();
  EXPECT_FALSE(encode_png(image).ok());
}

TEST(Pfm, KnownBytesBottomRowFirst) {
  ImageF32 image(1, 2, 3);
  image.pixels = {1, 2, 3, 4, 5, 6};
  const std::vector<std::byte> bytes = *encode_pfm(image);
  const std::string header = "PF\n1 2\n-1.0\n";
  ASSERT_EQ(bytes.size(), header.size() + 24);
  EXPECT_EQ(std::memcmp(bytes.data(), header.data(), header.size()), 0);
  const float rows[] = {4, 5, 6, 1, 2, 3};
  EXPECT_EQ(std::memcmp(bytes.data() + header.size(), rows, sizeof(rows)), 0);
}

TEST(Pfm, RoundTripKeepsEveryBit) {
  for (const uint32_t channels : {1u, 3u, 4u}) {
    ImageF32 image(5, 3, channels);
    for (size_t i = 0; i < image.pixels.size(); ++i)
      image.pixels[i] = 0.1f * static_cast<float>(i) - 1;
    image.pixels[0] = std::numeric_limits<float>::infinity();
    image.pixels[1] = -0.0f;
    const Result<ImageF32> back = decode_pfm(*encode_pfm(image), "x.pfm");
    ASSERT_TRUE(back.ok()) << back.status().message();
    EXPECT_EQ(back->channels, channels);
    EXPECT_EQ(
        std::memcmp(back->pixels.data(), image.pixels.data(), image.pixels.size() * sizeof(float)),
        0);
  }
}

TEST(Pfm, ReadsBigEndian) {
  const std::string file("Pf\n1 1\n1.0\n\x3f\x80\x00\x00", 15);
  const Result<ImageF32> image = decode_pfm(bytes_of(file), "x.pfm");
  ASSERT_TRUE(image.ok()) << image.status().message();
  EXPECT_EQ(image->pixels[0], 1.0f);
}

TEST(Pfm, BrokenFilesAreErrors) {
  const std::vector<std::byte> sound = *encode_pfm(ImageF32(3, 2, 4));
  for (size_t length = 0; length < sound.size(); ++length)
    EXPECT_FALSE(decode_pfm(std::span(sound).first(length), "x.pfm").ok()) << length;
  for (const std::string& text :
       {std::string("P6\n1 1\n-1.0\n0000"), std::string("PF\n0 1\n-1.0\n"),
        std::string("PF\n1 -1\n-1.0\n"), std::string("Pf\n1 1\n0.0\n0000"),
        std::string("Pf\n1 1\nnan\n0000"), std::string("Pf\n1 1\n-1.0\n00000"),
        std::string("Pf\n99999999 99999999\n-1.0\n0000")}) {
    const Result<ImageF32> image = decode_pfm(bytes_of(text), "x.pfm");
    ASSERT_FALSE(image.ok()) << text;
    EXPECT_EQ(image.status().code(), StatusCode::kCorrupt);
  }
}

}  // namespace
}  // namespace figurine::ports::image_test
