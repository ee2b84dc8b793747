// Video: the header, planes and colours of y4m by hand, and that neither kind of file leaves
// anything half-written.
#include "ports/media/video.h"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "ports/host/atomic_file.h"
#include "ports/media/y4m.h"
#include "tests/ports/media/temporary_folder.h"

namespace figurine::ports::video_test {
namespace {

ImageU8 plain(uint32_t width, uint32_t height, uint8_t r, uint8_t g, uint8_t b) {
  ImageU8 image(width, height, 3);
  for (size_t i = 0; i < image.pixels.size(); i += 3)
    image.pixels[i] = r, image.pixels[i + 1] = g, image.pixels[i + 2] = b;
  return image;
}

struct Codes {
  int y, cb, cr;
};
Codes codes_of(uint32_t height, uint8_t r, uint8_t g, uint8_t b) {
  std::vector<std::byte> out;
  append_y4m_frame(plain(2, height, r, g, b), out);
  return {static_cast<int>(out[6]), static_cast<int>(out[6 + 2 * height]),
          static_cast<int>(out[6 + 2 * height + height / 2])};
}

// The bars of ITU-R BT.601 and BT.709 in 8-bit limited range, as printed in every table of them.
TEST(Y4m, ColoursAreTheStandardsOwn) {
  const auto expect = [](const Codes& codes, int y, int cb, int cr) {
    EXPECT_EQ(codes.y, y);
    EXPECT_EQ(codes.cb, cb);
    EXPECT_EQ(codes.cr, cr);
  };
  for (const uint32_t height : {2u, 578u}) {
    expect(codes_of(height, 0, 0, 0), 16, 128, 128);
    expect(codes_of(height, 255, 255, 255), 235, 128, 128);
    expect(codes_of(height, 128, 128, 128), 126, 128, 128);
  }
  expect(codes_of(2, 255, 0, 0), 81, 90, 240);  // BT.601
  expect(codes_of(2, 0, 255, 0), 145, 54, 34);
  expect(codes_of(2, 0, 0, 255), 41, 240, 110);
  expect(codes_of(576, 255, 0, 0), 81, 90, 240);
  expect(codes_of(578, 255, 0, 0), 63, 102, 240);  // BT.709
  expect(codes_of(578, 0, 255, 0), 173, 42, 26);
  expect(codes_of(578, 0, 0, 255), 32, 240, 118);
}

TEST(Y4m, ChromaIsTheMeanOfABlock) {
  ImageU8 image = plain(2, 2, 255, 0, 0);
  for (int i : {0, 3}) std::fill_n(&image.pixels[3 * i], 3, 255);  // two red, two white pixels
  std::vector<std::byte> out;
  append_y4m_frame(image, out);
  EXPECT_EQ(static_cast<int>(out[6 + 4]), 109);  // (90.2 + 128) / 2
  EXPECT_EQ(static_cast<int>(out[6 + 5]), 184);
}

TEST(Y4m, OddSizesRoundChromaUp) {
  std::vector<std::byte> out;
  append_y4m_frame(plain(5, 3, 10, 20, 30), out);
  EXPECT_EQ(out.size(), 6u + 15 + 2 * 6);
  EXPECT_EQ(out[6 + 15], out[6 + 15 + 5]) << "the edge repeats its own colour";
}

TEST(FrameRate, FractionsAreExact) {
  const auto expect = [](double rate, uint32_t numerator, uint32_t denominator) {
    const Result<FrameRate> fraction = make_frame_rate(rate);
    ASSERT_TRUE(fraction.ok()) << rate;
    EXPECT_EQ(fraction->numerator, numerator) << rate;
    EXPECT_EQ(fraction->denominator, denominator) << rate;
  };
  expect(30, 30, 1);
  expect(120, 120, 1);
  expect(12.5, 25, 2);
  expect(29.97, 30000, 1001);
  expect(23.976, 24000, 1001);
  expect(7.2, 36, 5);
  for (const double rate : {0.0, -1.0, 1e4, std::nan("")}) EXPECT_FALSE(make_frame_rate(rate).ok());
}

TEST(VideoWriter, Y4mAppearsWholeOrNotAtAll) {
  const TemporaryFolder folder;
  {
    auto writer =
        VideoWriter::create(folder.path("x.y4m"), {.width_px = 4, .height_px = 4, .rate = {}});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE((*writer)->add(plain(4, 4, 1, 2, 3)).ok());
    EXPECT_FALSE(std::filesystem::exists(folder.path("x.y4m")));
  }
  EXPECT_EQ(folder.files(), 0u) << "abandoned";
  auto writer =
      VideoWriter::create(folder.path("x.y4m"), {.width_px = 4, .height_px = 4, .rate = {}});
  ASSERT_TRUE((*writer)->add(plain(4, 4, 1, 2, 3)).ok());
  ASSERT_TRUE((*writer)->finish().ok());
  EXPECT_EQ(folder.files(), 1u);
  const std::string header = "YUV4MPEG2 W4 H4 F30:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
  EXPECT_EQ(folder.read("x.y4m").substr(0, header.size() + 6), header + "FRAME\n");
  EXPECT_EQ(std::filesystem::file_size(folder.path("x.y4m")), header.size() + 6 + 16 + 8);
}

bool has_ffmpeg() {
  return std::system("ffmpeg -hide_banner -encoders 2> /dev/null | grep -q libx264") == 0;
}

TEST(VideoWriter, Mp4KeepsColoursAndSizesThroughFfmpeg) {
  if (!has_ffmpeg())
    GTEST_SKIP()
        << "needs ffmpeg with libx264, which scripts/setup toolchain installs: runs in dev";
  const TemporaryFolder folder;
  auto writer =
      VideoWriter::create(folder.path("x.mp4"), {.width_px = 64, .height_px = 48, .rate = {25, 1}});
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  for (int i = 0; i < 5; ++i) ASSERT_TRUE((*writer)->add(plain(64, 48, 200, 120, 40)).ok());
  const Status status = (*writer)->finish();
  ASSERT_TRUE(status.ok()) << status.message();
  EXPECT_EQ(folder.files(), 1u);
  const std::string decode = "ffmpeg -hide_banner -loglevel error -i " + folder.path("x.mp4") +
                             " -f rawvideo -pix_fmt rgb24 " + folder.path("raw");
  ASSERT_EQ(std::system(decode.c_str()), 0);
  const std::string raw = folder.read("raw");
  ASSERT_EQ(raw.size(), 5u * 64 * 48 * 3);
  const int expected[] = {200, 120, 40};
  for (size_t i = 0; i < raw.size(); ++i)
    ASSERT_NEAR(static_cast<unsigned char>(raw[i]), expected[i % 3], 4) << i;
}

TEST(VideoWriter, WebmAndGifGoThroughFfmpegWithTheirAlpha) {
  if (!has_ffmpeg())
    GTEST_SKIP() << "needs ffmpeg, which scripts/setup toolchain installs: runs in dev";
  const TemporaryFolder folder;
  ImageU8 frame(64, 48, 4);  // a red half that is there, and one that is not
  for (uint32_t y = 0; y < 48; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      frame.at(x, y)[0] = 220;
      frame.at(x, y)[1] = frame.at(x, y)[2] = 30;
      frame.at(x, y)[3] = x < 32 ? 255 : 0;
    }
  }
  for (const char* name : {"x.webm", "x.GIF"}) {
    auto writer = VideoWriter::create(
        folder.path(name), {.width_px = 64, .height_px = 48, .rate = {25, 1}, .alpha = true});
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    for (int i = 0; i < 3; ++i) ASSERT_TRUE((*writer)->add(frame).ok());
    const Status status = (*writer)->finish();
    ASSERT_TRUE(status.ok()) << status.message();
    const std::string raw = folder.path(std::string(name) + ".raw");
    const std::string decoder = std::string(name) == "x.webm" ? "-c:v libvpx-vp9 " : "";
    ASSERT_EQ(std::system(("ffmpeg -hide_banner -loglevel error " + decoder + "-i " +
                           folder.path(name) + " -f rawvideo -pix_fmt rgba " + raw)
                              .c_str()),
              0);
    const std::string pixels = folder.read(std::string(name) + ".raw");
    ASSERT_EQ(pixels.size(), 3u * 64 * 48 * 4) << name;
    for (const uint32_t x : {8u, 56u}) {
      const auto* pixel = reinterpret_cast<const uint8_t*>(&pixels[4 * (24 * 64 + x)]);
      EXPECT_NEAR(pixel[3], x < 32 ? 255 : 0, 3) << name << " " << x;
      if (x < 32) {
        EXPECT_NEAR(pixel[0], 220, 8) << name;
      }
    }
  }
}

TEST(VideoWriter, Y4mColoursAreWhatFfmpegSees) {
  if (!has_ffmpeg())
    GTEST_SKIP() << "needs ffmpeg, which scripts/setup toolchain installs: runs in dev";
  const TemporaryFolder folder;
  auto writer =
      VideoWriter::create(folder.path("x.y4m"), {.width_px = 16, .height_px = 16, .rate = {}});
  ASSERT_TRUE((*writer)->add(plain(16, 16, 30, 180, 220)).ok());
  ASSERT_TRUE((*writer)->finish().ok());
  ASSERT_EQ(std::system(("ffmpeg -hide_banner -loglevel error -i " + folder.path("x.y4m") +
                         " -f rawvideo -pix_fmt rgb24 " + folder.path("raw"))
                            .c_str()),
            0);
  const std::string raw = folder.read("raw");
  ASSERT_EQ(raw.size(), 16u * 16 * 3);
  const int expected[] = {30, 180, 220};
  for (size_t i = 0; i < raw.size(); ++i)
    ASSERT_NEAR(static_cast<unsigned char>(raw[i]), expected[i % 3], 3) << i;
}

TEST(VideoWriter, AnAbandonedMp4LeavesNothing) {
  if (!has_ffmpeg())
    GTEST_SKIP() << "needs ffmpeg, which scripts/setup toolchain installs: runs in dev";
  const TemporaryFolder folder;
  {
    auto writer =
        VideoWriter::create(folder.path("x.mp4"), {.width_px = 64, .height_px = 48, .rate = {}});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE((*writer)->add(plain(64, 48, 1, 2, 3)).ok());
  }
  EXPECT_EQ(folder.files(), 0u);
}

TEST(VideoWriter, OtherNamesAreUnsupported) {
  const TemporaryFolder folder;
  const auto writer =
      VideoWriter::create(folder.path("x.avi"), {.width_px = 4, .height_px = 4, .rate = {}});
  ASSERT_FALSE(writer.ok());
  EXPECT_EQ(writer.status().code(), StatusCode::kUnsupported);
}

TEST(AtomicFile, IsInvisibleUntilCommitted) {
  const TemporaryFolder folder;
  const std::string text = "content";
  {
    Result<AtomicFile> file = AtomicFile::create(folder.path("x"));
    ASSERT_TRUE(file.ok()) << file.status().message();
    ASSERT_TRUE(file->write(std::as_bytes(std::span(text))).ok());
    ASSERT_TRUE(file->finish().ok());
    EXPECT_FALSE(std::filesystem::exists(folder.path("x")));
    EXPECT_TRUE(std::filesystem::exists(file->temporary_path()));
    ASSERT_TRUE(file->commit().ok());
  }
  EXPECT_EQ(folder.read("x"), text);
  EXPECT_EQ(folder.files(), 1u);
}

TEST(AtomicFile, SaysWhyItCannotBeWritten) {
  const TemporaryFolder folder;
  const Result<AtomicFile> missing = AtomicFile::create(folder.path("no/such/x"));
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.status().message().find("no/such/x"), std::string::npos);
  EXPECT_FALSE(AtomicFile::create("/dev/null").ok());
  EXPECT_FALSE(AtomicFile::create(folder.path("")).ok());
}

}  // namespace
}  // namespace figurine::ports::video_test
