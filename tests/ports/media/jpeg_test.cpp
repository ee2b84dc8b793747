#include "ports/media/jpeg.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>

namespace figurine::ports::jpeg_test {
namespace {

// Smooth in all channels, with chroma that changes from pixel to pixel.
ImageU8 colourful() {
  ImageU8 image(64, 48, 3);
  for (uint32_t y = 0; y < 48; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      image.at(x, y)[0] = static_cast<uint8_t>(4 * x);
      image.at(x, y)[1] = static_cast<uint8_t>(5 * y);
      image.at(x, y)[2] = static_cast<uint8_t>(128 + 100 * std::sin(0.3 * (x + y)));
    }
  }
  return image;
}

TEST(Jpeg, Quality97KeepsMoreThan42Decibels) {
  const ImageU8 image = colourful();
  const ImageU8 back = decode_jpeg(*encode_jpeg(image, 97), "memory").value();
  ASSERT_EQ(back.pixels.size(), image.pixels.size());
  double squares = 0;
  for (size_t i = 0; i < image.pixels.size(); ++i)
    squares += (image.pixels[i] - back.pixels[i]) * (image.pixels[i] - back.pixels[i]);
  const double psnr_db =
      10 * std::log10(255.0 * 255 * static_cast<double>(image.pixels.size()) / squares);
  EXPECT_GT(psnr_db, 42);
  std::printf("PSNR after quality 97: %.1f dB\n", psnr_db);
}

// Columns of one luma and two chromas: with chroma at half resolution they would melt into one
// colour.
TEST(Jpeg, ChromaKeepsFullResolution) {
  ImageU8 image(32, 32, 3);
  for (uint32_t y = 0; y < 32; ++y) {
    for (uint32_t x = 0; x < 32; ++x) {
      const bool odd = x % 2 != 0;
      image.at(x, y)[0] = odd ? 200 : 100;
      image.at(x, y)[1] = odd ? 100 : 151;
      image.at(x, y)[2] = 120;
    }
  }
  const ImageU8 back = decode_jpeg(*encode_jpeg(image, 97), "memory").value();
  for (uint32_t x = 0; x + 1 < 32; x += 2)
    ASSERT_GT(back.at(x + 1, 16)[0] - back.at(x, 16)[0], 80) << x;
}

TEST(Jpeg, SameImageSameBytes) {
  EXPECT_EQ(*encode_jpeg(colourful(), 97), *encode_jpeg(colourful(), 97));
}

TEST(Jpeg, SizeComesFromTheHeader) {
  const JpegSize size = decode_jpeg_size(*encode_jpeg(colourful(), 90), "memory").value();
  EXPECT_EQ(size.width_px, 64u);
  EXPECT_EQ(size.height_px, 48u);
}

TEST(Jpeg, EveryPrefixIsDamaged) {
  const std::vector<std::byte> whole = *encode_jpeg(colourful(), 60);
  for (size_t length = 0; length < whole.size(); ++length) {
    const Result<ImageU8> image = decode_jpeg(std::span(whole).first(length), "prefix");
    ASSERT_EQ(image.status().code(), StatusCode::kCorrupt) << length;
    ASSERT_EQ(image.status().message().rfind("prefix: ", 0), 0u) << length;
  }
}

// Flipped bytes may still decode, to another picture; they must never crash or hang.
TEST(Jpeg, FlippedBytesDecodeOrAreReported) {
  const std::vector<std::byte> whole = *encode_jpeg(colourful(), 60);
  size_t reported = 0;
  for (size_t i = 0; i < whole.size(); ++i) {
    std::vector<std::byte> bytes = whole;
    bytes[i] ^= std::byte{0x55};
    const Result<ImageU8> image = decode_jpeg(bytes, "flipped");
    reported += !image.ok();
    if (!image.ok()) continue;
    EXPECT_EQ(image->pixels.size(), size_t{image->width_px} * image->height_px * 3);
  }
  EXPECT_GT(reported, 0u);
}

}  // namespace
}  // namespace figurine::ports::jpeg_test
