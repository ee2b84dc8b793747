// Animated WebP, read back by libwebp's own decoder: pictures, alpha, times.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <webp/demux.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "ports/host/files.h"
#include "ports/media/video.h"
#include "tests/ports/media/temporary_folder.h"

namespace figurine::ports::webp_test {
namespace {

// A disc of alpha 255 with a soft edge on nothing, shaded, at a place that moves with i; without
// alpha a darker disc (chroma, at half the resolution, has no edge to keep). Nothing changes by a
// little only: that is what the encoder leaves as it was.
ImageU8 disc(uint32_t width, uint32_t height, int i, uint32_t channels) {
  ImageU8 image(width, height, channels);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      uint8_t* pixel = image.at(x, y);
      pixel[0] = 200;
      pixel[1] = static_cast<uint8_t>(60 + y);
      pixel[2] = 90;
      const double r = std::hypot(x - 20.0 - 3 * i, y - 24.0);
      if (channels == 3) {
        for (int c = 0; c < 3 && r < 12; ++c) pixel[c] /= 3;
        continue;
      }
      pixel[3] = static_cast<uint8_t>(std::clamp(255 * (14 - r) / 4, 0.0, 255.0));
    }
  }
  return image;
}

struct Decoded {
  std::vector<ImageU8> frames;  // RGBA, straight alpha
  std::vector<int> ends_ms;
};

Decoded decode(const std::string& path) {
  const MappedFile file = MappedFile::open(path).value();
  const WebPData data{reinterpret_cast<const uint8_t*>(file.bytes().data()), file.bytes().size()};
  const std::unique_ptr<WebPAnimDecoder, void (*)(WebPAnimDecoder*)> decoder(
      WebPAnimDecoderNew(&data, nullptr), WebPAnimDecoderDelete);
  Decoded decoded;
  if (decoder == nullptr) return decoded;
  WebPAnimInfo info;
  WebPAnimDecoderGetInfo(decoder.get(), &info);
  while (WebPAnimDecoderHasMoreFrames(decoder.get())) {
    uint8_t* pixels = nullptr;
    int end_ms = 0;
    if (WebPAnimDecoderGetNext(decoder.get(), &pixels, &end_ms) == 0) break;
    ImageU8& frame = decoded.frames.emplace_back(info.canvas_width, info.canvas_height, 4u);
    frame.pixels.assign(pixels, pixels + size_t{4} * info.canvas_width * info.canvas_height);
    decoded.ends_ms.push_back(end_ms);
  }
  return decoded;
}

TEST(Webp, KeepsPicturesAlphaAndTimes) {
  constexpr int kFrames = 7;
  for (const uint32_t channels : {3u, 4u}) {
    const TemporaryFolder folder;
    auto writer = VideoWriter::create(
        folder.path("x.WebP"),
        {.width_px = 61, .height_px = 47, .rate = {30000, 1001}, .alpha = channels == 4});
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    for (int i = 0; i < kFrames; ++i) ASSERT_TRUE((*writer)->add(disc(61, 47, i, channels)).ok());
    ASSERT_TRUE((*writer)->finish().ok());
    EXPECT_EQ(folder.files(), 1u);
    const Decoded decoded = decode(folder.path("x.WebP"));
    ASSERT_EQ(decoded.frames.size(), size_t{kFrames});
    for (int i = 0; i < kFrames; ++i) {
      EXPECT_EQ(decoded.ends_ms[i], std::lround((i + 1) * 1001 / 30.0)) << i;
      const ImageU8 expected = disc(61, 47, i, channels);
      double squares = 0, count = 0;
      int alpha_error = 0;
      for (uint32_t y = 0; y < 47; ++y) {
        for (uint32_t x = 0; x < 61; ++x) {
          const uint8_t* seen = decoded.frames[i].at(x, y);
          const uint8_t* drawn = expected.at(x, y);
          const int alpha = channels == 4 ? drawn[3] : 255;
          alpha_error = std::max(alpha_error, std::abs(alpha - seen[3]));
          if (alpha < 255) continue;
          for (int c = 0; c < 3; ++c) squares += std::pow(seen[c] - drawn[c], 2), ++count;
        }
      }
      EXPECT_EQ(alpha_error, 0) << "alpha is kept as it is";
      const double psnr_db = 10 * std::log10(255 * 255 * count / squares);
      EXPECT_GT(psnr_db, 35) << i;
    }
  }
}

TEST(Webp, OneFrameIsAPicture) {
  const TemporaryFolder folder;
  auto writer = VideoWriter::create(folder.path("x.webp"),
                                    {.width_px = 61, .height_px = 47, .rate = {}, .alpha = true});
  ASSERT_TRUE((*writer)->add(disc(61, 47, 0, 4)).ok());
  ASSERT_TRUE((*writer)->finish().ok());
  EXPECT_EQ(decode(folder.path("x.webp")).frames.size(), 1u);
}

TEST(Webp, WhatCannotBeIsRefusedAndLeavesNothing) {
  const TemporaryFolder folder;
  EXPECT_EQ(VideoWriter::create(folder.path("x.webp"), {.width_px = 16384, .height_px = 2})
                .status()
                .code(),
            StatusCode::kLimitExceeded);
  EXPECT_EQ(
      VideoWriter::create(folder.path("x.mp4"), {.width_px = 4, .height_px = 4, .alpha = true})
          .status()
          .code(),
      StatusCode::kInvalidArgument);
  auto writer = VideoWriter::create(folder.path("x.webp"), {.width_px = 4, .height_px = 4});
  EXPECT_EQ((*writer)->add(ImageU8(4, 5, 3)).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ((*writer)->add(ImageU8(4, 4, 4)).code(), StatusCode::kInvalidArgument);
  EXPECT_FALSE((*writer)->finish().ok()) << "no frame";
  writer->reset();
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace figurine::ports::webp_test
