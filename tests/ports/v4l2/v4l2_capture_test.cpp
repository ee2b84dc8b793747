// A camera that a test made: its pictures arrive in the right colours whatever format, stride,
// matrix and range it has, the newest counts, broken ones are left out, and every way in which a
// camera says no gets one line.
#include "ports/v4l2/v4l2_capture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ports/media/jpeg.h"
#include "ports/media/yuv.h"
#include "ports/v4l2/fake_device.h"

namespace figurine::ports::v4l2_capture_test {
namespace {

using tests::FakeDevice;

uint64_t fake_now_ns = 0;

Result<std::unique_ptr<V4l2Capture>> open(FakeDevice& device, uint32_t width = 6,
                                          uint32_t height = 4) {
  return V4l2Capture::open("/dev/video7", {.width_px = width,
                                           .height_px = height,
                                           .frames_per_second = 29.97,
                                           .now_ns = [] { return fake_now_ns; },
                                           .system = &device});
}

FakeDevice camera(std::vector<uint32_t> formats = {V4L2_PIX_FMT_YUYV}) {
  FakeDevice device;
  device.become_camera();
  device.formats = std::move(formats);
  return device;
}

// Blocks of two by two, of one colour each: what 4:2:0 can say.
ImageU8 blocks(uint32_t width, uint32_t height) {
  ImageU8 image(width, height, 3);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      image.at(x, y)[0] = static_cast<uint8_t>(30 + 70 * (x / 2));
      image.at(x, y)[1] = static_cast<uint8_t>(220 - 90 * (y / 2));
      image.at(x, y)[2] = static_cast<uint8_t>(40 * (x / 2) + 25 * (y / 2));
    }
  }
  return image;
}

// The codes of a picture as a camera with that stride has them.
std::vector<uint8_t> yuyv(const ImageU8& rgb, YcbcrMatrix matrix, size_t padding = 0) {
  std::vector<uint8_t> codes;
  for (uint32_t y = 0; y < rgb.height_px; ++y) {
    std::vector<uint8_t> row(size_t{2} * rgb.width_px);
    yuyv_row({rgb.at(0, y), size_t{3} * rgb.width_px}, matrix, row);
    codes.insert(codes.end(), row.begin(), row.end());
    codes.resize(codes.size() + padding, 0xEE);
  }
  return codes;
}

std::vector<uint8_t> nv12(const ImageU8& rgb, YcbcrMatrix matrix, size_t padding = 0) {
  std::vector<uint8_t> codes, row(rgb.width_px);
  const auto source = [&](uint32_t y) {
    return std::span<const uint8_t>(rgb.at(0, y), size_t{3} * rgb.width_px);
  };
  const auto add = [&] {
    codes.insert(codes.end(), row.begin(), row.end());
    codes.resize(codes.size() + padding, 0xEE);
  };
  for (uint32_t y = 0; y < rgb.height_px; ++y) luma_row(source(y), matrix, row), add();
  for (uint32_t y = 0; y < rgb.height_px; y += 2)
    interleaved_chroma_row(source(y), source(y + 1), matrix, row), add();
  return codes;
}

void expect_near(const ImageU8& got, const ImageU8& wanted, int most) {
  ASSERT_EQ(got.width_px, wanted.width_px);
  ASSERT_EQ(got.height_px, wanted.height_px);
  ASSERT_EQ(got.channels, 3u);
  int largest = 0;
  for (size_t i = 0; i < got.pixels.size(); ++i)
    largest = std::max(largest, std::abs(int{got.pixels[i]} - wanted.pixels[i]));
  EXPECT_LE(largest, most);
}

ImageU8 next_of(V4l2Capture& capture) {
  ImageU8 picture;
  const Result<bool> came = capture.next(picture, fake_now_ns);
  EXPECT_TRUE(came.ok()) << came.status().message();
  EXPECT_TRUE(came.ok() && *came);
  return picture;
}

// Limited range has 219 codes for 255: two codes off at most, there and back.
TEST(V4l2Capture, PicturesHaveTheirColours) {
  const ImageU8 wanted = blocks(6, 4);
  const struct {
    uint32_t space, encoding;
    YcbcrMatrix matrix;
  } stated[] = {{V4L2_COLORSPACE_DEFAULT, V4L2_YCBCR_ENC_DEFAULT, YcbcrMatrix::kBt601},
                {V4L2_COLORSPACE_SMPTE170M, V4L2_YCBCR_ENC_DEFAULT, YcbcrMatrix::kBt601},
                {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_DEFAULT, YcbcrMatrix::kBt601},
                {V4L2_COLORSPACE_REC709, V4L2_YCBCR_ENC_DEFAULT, YcbcrMatrix::kBt709},
                {V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_709, YcbcrMatrix::kBt709}};
  for (const auto& each : stated) {
    for (const uint32_t padding : {0u, 10u}) {
      for (const bool planes : {false, true}) {
        FakeDevice device = camera({planes ? V4L2_PIX_FMT_NV12 : V4L2_PIX_FMT_YUYV});
        device.colorspace = each.space, device.encoding = each.encoding;
        device.stride_padding = padding;
        {
          auto capture = open(device);
          ASSERT_TRUE(capture.ok()) << capture.status().message();
          for (int i = 0; i < 5; ++i) {
            device.given.push_back(
                {planes ? nv12(wanted, each.matrix, padding) : yuyv(wanted, each.matrix, padding)});
            expect_near(next_of(**capture), wanted, 2);
          }
        }
        EXPECT_EQ(device.streams_on, 1);
        EXPECT_EQ(device.streams_off, 1);
        EXPECT_EQ(device.mapped, device.unmapped);
        EXPECT_EQ(device.closed, 1);
      }
    }
  }
}

TEST(V4l2Capture, FullRangeIsRead) {
  FakeDevice device = camera();
  device.range = V4L2_QUANTIZATION_FULL_RANGE;
  auto capture = open(device, 2, 1);
  ASSERT_TRUE(capture.ok()) << capture.status().message();
  device.given.push_back({{0, 128, 255, 128}});
  const ImageU8 picture = next_of(**capture);
  EXPECT_EQ(picture.pixels, (std::vector<uint8_t>{0, 0, 0, 255, 255, 255}));
  // Red of JFIF: Y 76, Cb 85, Cr 255.
  device.given.push_back({{76, 85, 76, 255}});
  const ImageU8 red = next_of(**capture);
  EXPECT_NEAR(red.pixels[0], 254, 1);
  EXPECT_NEAR(red.pixels[1], 0, 1);
  EXPECT_NEAR(red.pixels[2], 0, 1);
}

std::vector<uint8_t> jpeg_of(const ImageU8& image) {
  const std::vector<std::byte> bytes = *encode_jpeg(image, 95);
  const auto* const first = reinterpret_cast<const uint8_t*>(bytes.data());
  return {first, first + bytes.size()};
}

TEST(V4l2Capture, ReadsMotionJpeg) {
  ImageU8 wanted(32, 16, 3);
  for (size_t i = 0; i < wanted.pixels.size(); ++i)
    wanted.pixels[i] = static_cast<uint8_t>(60 + i / 3 % 32 * 3);
  FakeDevice device = camera({V4L2_PIX_FMT_MJPEG});
  auto capture = open(device, 32, 16);
  ASSERT_TRUE(capture.ok()) << capture.status().message();
  EXPECT_EQ((*capture)->format(), V4l2Capture::Format::kMjpeg);
  device.given.push_back({jpeg_of(wanted)});
  expect_near(next_of(**capture), wanted, 6);
}

// Raw pictures while they are large enough; large ones are had as MJPEG alone.
TEST(V4l2Capture, TakesTheFormatThatIsLargeEnough) {
  const auto taken = [](std::vector<uint32_t> formats, std::map<uint32_t, uint32_t> largest) {
    FakeDevice device = camera(std::move(formats));
    device.largest_width = std::move(largest);
    auto capture = open(device, 64, 48);
    EXPECT_TRUE(capture.ok()) << capture.status().message();
    return std::pair((*capture)->format(), (*capture)->width_px());
  };
  using Format = V4l2Capture::Format;
  const uint32_t mjpeg = V4L2_PIX_FMT_MJPEG, raw = V4L2_PIX_FMT_YUYV, nv = V4L2_PIX_FMT_NV12;
  EXPECT_EQ(taken({mjpeg, nv, raw}, {}), std::pair(Format::kYuyv, 64u));
  EXPECT_EQ(taken({mjpeg, raw}, {{raw, 32}}), std::pair(Format::kMjpeg, 64u));
  EXPECT_EQ(taken({mjpeg, raw}, {{raw, 32}, {mjpeg, 16}}), std::pair(Format::kYuyv, 32u));
  EXPECT_EQ(taken({nv, V4L2_PIX_FMT_GREY}, {}), std::pair(Format::kNv12, 64u));
}

TEST(V4l2Capture, TheNewestCounts) {
  FakeDevice device = camera();
  auto capture = open(device, 2, 1);
  ASSERT_TRUE(capture.ok());
  for (const uint8_t luma : {20, 60, 235}) device.given.push_back({{luma, 128, luma, 128}});
  EXPECT_EQ(next_of(**capture).pixels[0], 255);
  ImageU8 kept(2, 1, 3);
  kept.pixels.assign(6, 9);
  EXPECT_FALSE(*(*capture)->next(kept, fake_now_ns)) << "the others were older";
  EXPECT_EQ(kept.pixels[0], 9);
  EXPECT_EQ((*capture)->broken_pictures(), 0u);
  device.given.push_back({{16, 128, 16, 128}});
  EXPECT_EQ(next_of(**capture).pixels[0], 0) << "every buffer is the driver's again";
}

TEST(V4l2Capture, BrokenPicturesAreLeftOutAndCounted) {
  FakeDevice device = camera();
  device.interrupt_everything();
  auto capture = open(device, 2, 1);
  ASSERT_TRUE(capture.ok()) << capture.status().message();
  const std::vector<uint8_t> white = {235, 128, 235, 128};
  device.given.push_back({white});
  device.given.push_back({{16, 128}});  // cut off
  device.given.push_back({{16, 128, 16, 128}, V4L2_BUF_FLAG_ERROR});
  device.given.push_back({{}});
  EXPECT_EQ(next_of(**capture).pixels[0], 255);
  EXPECT_EQ((*capture)->broken_pictures(), 3u);
  FakeDevice jpegs = camera({V4L2_PIX_FMT_MJPEG});
  auto moving = open(jpegs, 8, 8);
  ASSERT_TRUE(moving.ok());
  const std::vector<uint8_t> whole = jpeg_of(ImageU8(8, 8, 3));
  ImageU8 picture;
  for (size_t size = 1; size < whole.size(); size += 7) {
    jpegs.given.push_back({{whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}});
    const Result<bool> came = (*moving)->next(picture, fake_now_ns);
    ASSERT_TRUE(came.ok()) << came.status().message();
    EXPECT_FALSE(*came) << size << " of " << whole.size();
  }
  EXPECT_EQ((*moving)->broken_pictures(), (whole.size() - 2) / 7 + 1);
  jpegs.given.push_back({whole});
  EXPECT_TRUE(*(*moving)->next(picture, fake_now_ns)) << "and on it goes";
}

// The one line that opening gives, and whatever was taken is given back.
std::string refusal(FakeDevice& device) {
  const auto capture = open(device);
  EXPECT_FALSE(capture.ok());
  EXPECT_EQ(device.opened, device.closed);
  EXPECT_EQ(device.mapped, device.unmapped);
  const std::string message = capture.status().message();
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_EQ(message.rfind("/dev/video7: ", 0), 0u) << message;
  return message.substr(std::min<size_t>(message.size(), 13));
}

TEST(V4l2Capture, SaysWhyACameraCannotBeUsed) {
  const auto expect = [](const std::string& wanted, const auto& change) {
    FakeDevice device = camera();
    change(device);
    const std::string said = refusal(device);
    EXPECT_EQ(said.rfind(wanted, 0), 0u) << wanted << "\n" << said;
  };
  const auto failing = [](unsigned long request, int error) {
    return [=](FakeDevice& d) { d.fail(request, error, 0, true); };
  };
  expect("cannot be opened for reading: No such file", failing(FakeDevice::kOpen, ENOENT));
  expect("cannot be opened for reading: in use by another program",
         failing(FakeDevice::kOpen, EBUSY));
  expect("is no video device", failing(VIDIOC_QUERYCAP, ENOTTY));
  expect("is no camera", [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_OUTPUT; });
  expect("gives pictures in several planes only",
         [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_CAPTURE_MPLANE; });
  expect("has no streaming", [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_CAPTURE; });
  expect("gives none of YUYV", [](FakeDevice& d) { d.formats = {V4L2_PIX_FMT_GREY}; });
  expect("gives none of YUYV", [](FakeDevice& d) { d.insists_on_format = V4L2_PIX_FMT_GREY; });
  expect("gives none of YUYV", failing(VIDIOC_S_FMT, EINVAL));
  expect("takes no format: in use by another program", failing(VIDIOC_S_FMT, EBUSY));
  expect("states a picture of 36 bytes in rows of 12, which cannot hold 6x4",
         [](FakeDevice& d) { d.sizeimage_off = 12; });
  expect("the device is gone", failing(VIDIOC_S_PARM, ENODEV));
  expect("gives no buffers: Cannot allocate memory", failing(VIDIOC_REQBUFS, ENOMEM));
  expect("gives 4000 buffers", [](FakeDevice& d) { d.buffer_count = 4000; });
  expect("gives a buffer of 47 bytes for frames of 48",
         [](FakeDevice& d) { d.buffer_bytes_off = 1; });
  expect("a buffer cannot be mapped", [](FakeDevice& d) { d.fail(FakeDevice::kMap, ENOMEM, 2); });
  expect("takes no frame: Input/output error", failing(VIDIOC_QBUF, EIO));
  expect("does not start: Input/output error", failing(VIDIOC_STREAMON, EIO));
}

TEST(V4l2Capture, SaysWhyACameraWasLost) {
  const auto expect = [](const std::string& wanted, const auto& change) {
    FakeDevice device = camera();
    auto capture = open(device, 2, 1);
    ASSERT_TRUE(capture.ok());
    device.given.push_back({{16, 128, 16, 128}});
    next_of(**capture);
    change(device);
    device.given.push_back({{16, 128, 16, 128}});
    ImageU8 picture;
    const Result<bool> came = (*capture)->next(picture, fake_now_ns + 100);
    ASSERT_FALSE(came.ok()) << wanted;
    EXPECT_EQ(came.status().message(), "/dev/video7: " + wanted);
    capture->reset();
    EXPECT_EQ(device.closed, 1);
    EXPECT_EQ(device.mapped, device.unmapped);
  };
  const auto failing = [](unsigned long request, int error) {
    return [=](FakeDevice& d) { d.fail(request, error, 0, true); };
  };
  expect("the device is gone", failing(VIDIOC_DQBUF, ENODEV));
  expect("gave no buffer back: Input/output error", failing(VIDIOC_DQBUF, EIO));
  expect("takes no frame: Input/output error", failing(VIDIOC_QBUF, EIO));
  expect("gave back a buffer that there is none of", [](FakeDevice& d) { d.wrong_index = 100; });
}

}  // namespace
}  // namespace figurine::ports::v4l2_capture_test
