// A video device that a test made: frames arrive in its buffers to the byte, whatever its stride,
// and every way in which a device says no gets one line.
#include "ports/v4l2/v4l2_output.h"

#include <gtest/gtest.h>

#include <numeric>

#include "ports/v4l2/fake_device.h"

namespace figurine::ports::v4l2_output_test {
namespace {

using tests::FakeDevice;

uint64_t fake_now_ns = 0;

Result<std::unique_ptr<V4l2Output>> open(FakeDevice& device, uint32_t width = 6,
                                         uint32_t height = 4) {
  return V4l2Output::open("/dev/video7", {.width_px = width,
                                          .height_px = height,
                                          .frames_per_second = 29.97,
                                          .now_ns = [] { return fake_now_ns; },
                                          .system = &device});
}

std::vector<uint8_t> numbered(size_t bytes) {
  std::vector<uint8_t> pixels(bytes);
  std::iota(pixels.begin(), pixels.end(), uint8_t{1});
  return pixels;
}

TEST(V4l2Output, FramesArriveToTheByteInEveryFormatAndStride) {
  const struct {
    uint32_t code;
    PixelFormat format;
    uint32_t row_bytes, rows;
  } formats[] = {{V4L2_PIX_FMT_YUYV, PixelFormat::kYuyv, 12, 4},
                 {V4L2_PIX_FMT_NV12, PixelFormat::kNv12, 6, 6},
                 {V4L2_PIX_FMT_RGB24, PixelFormat::kRgb24, 18, 4},
                 {V4L2_PIX_FMT_BGR24, PixelFormat::kBgr24, 18, 4}};
  for (const auto& each : formats) {
    for (const uint32_t padding : {0u, 2u, 64u}) {
      FakeDevice device;
      device.formats = {V4L2_PIX_FMT_MJPEG, each.code};
      device.stride_padding = padding;
      {
        auto output = open(device);
        ASSERT_TRUE(output.ok()) << output.status().message();
        EXPECT_EQ((*output)->format(), each.format);
        EXPECT_EQ((*output)->stride_bytes(), each.row_bytes + padding);
        const std::vector<uint8_t> pixels = numbered(size_t{each.row_bytes} * each.rows);
        for (int i = 0; i < 5; ++i) ASSERT_TRUE(*(*output)->show(pixels, 100));
        ASSERT_EQ(device.shown.size(), 5u);
        EXPECT_EQ(device.bytes_used[0], device.agreed.sizeimage);
        for (size_t y = 0; y < each.rows; ++y) {
          for (size_t x = 0; x < each.row_bytes + padding; ++x) {
            const uint8_t wanted = x < each.row_bytes ? pixels[y * each.row_bytes + x] : 0xEE;
            ASSERT_EQ(device.shown[0][y * (each.row_bytes + padding) + x], wanted) << x << " " << y;
          }
        }
      }
      EXPECT_EQ(device.streams_on, 1);
      EXPECT_EQ(device.streams_off, 1);
      EXPECT_EQ(device.mapped, device.unmapped);
      EXPECT_EQ(device.closed, 1);
    }
  }
}

TEST(V4l2Output, TellsTheDeviceWhatTheCodesMean) {
  FakeDevice device;
  ASSERT_TRUE(open(device).ok());
  EXPECT_EQ(device.agreed.colorspace, uint32_t{V4L2_COLORSPACE_SMPTE170M});
  EXPECT_EQ(device.agreed.ycbcr_enc, uint32_t{V4L2_YCBCR_ENC_601});
  EXPECT_EQ(device.agreed.quantization, uint32_t{V4L2_QUANTIZATION_LIM_RANGE});
  EXPECT_EQ(device.interval.numerator, 1000u);
  EXPECT_EQ(device.interval.denominator, 29970u);
}

TEST(V4l2Output, TakesTheFirstFormatThatTheSizeAllows) {
  FakeDevice device;
  device.formats = {V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_RGB24};
  EXPECT_EQ((*open(device, 6, 4))->format(), PixelFormat::kYuyv);
  EXPECT_EQ((*open(device, 6, 5))->format(), PixelFormat::kYuyv) << "odd heights are fine in 4:2:2";
  EXPECT_EQ((*open(device, 7, 5))->format(), PixelFormat::kRgb24);
  device.formats = {V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_BGR24};
  EXPECT_EQ((*open(device, 6, 5))->format(), PixelFormat::kBgr24);
  device.formats = {V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV};
  EXPECT_EQ(open(device, 7, 4).status().message(),
            "/dev/video7: what it takes has even sizes only, and 7x4 is odd");
}

TEST(V4l2Output, AFrameWithoutAFreeBufferIsTheCallersToDrop) {
  FakeDevice device;
  device.shows = false;
  auto output = open(device);
  ASSERT_TRUE(output.ok());
  const std::vector<uint8_t> pixels = numbered(48);
  const size_t buffers = (*output)->buffer_count();
  for (size_t i = 0; i < buffers; ++i) EXPECT_TRUE(*(*output)->show(pixels, 100));
  fake_now_ns = 100;
  EXPECT_FALSE(*(*output)->show(pixels, 100));
  EXPECT_EQ(device.polls, 0) << "the deadline is past: nothing to wait for";
  device.shows = true;
  EXPECT_TRUE(*(*output)->show(pixels, 100)) << "one is free again";
  EXPECT_EQ(device.shown.size(), buffers + 1);
  fake_now_ns = 0;
}

TEST(V4l2Output, SignalsAndBrokenBuffersAreNoErrors) {
  FakeDevice device;
  device.interrupt_everything();
  auto output = open(device);
  ASSERT_TRUE(output.ok()) << output.status().message();
  device.flags = V4L2_BUF_FLAG_ERROR;
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(*(*output)->show(numbered(48), 100));
  EXPECT_GT((*output)->broken_buffers(), 0u);
}

// The one line that opening gives, and whatever was taken is given back.
std::string refusal(FakeDevice& device, uint32_t width = 6, uint32_t height = 4) {
  const auto output = open(device, width, height);
  EXPECT_FALSE(output.ok());
  EXPECT_EQ(device.opened, device.closed);
  EXPECT_EQ(device.mapped, device.unmapped);
  const std::string message = output.status().message();
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_EQ(message.rfind("/dev/video7: ", 0), 0u) << message;
  return message.substr(std::min<size_t>(message.size(), 13));
}

TEST(V4l2Output, SaysWhyADeviceCannotBeUsed) {
  const auto expect = [](const std::string& wanted, const auto& change) {
    FakeDevice device;
    change(device);
    EXPECT_EQ(refusal(device).rfind(wanted, 0), 0u) << wanted << "\n" << refusal(device);
  };
  const auto failing = [](unsigned long request, int error) {
    return [=](FakeDevice& d) { d.fail(request, error, 0, true); };
  };
  expect("cannot be opened for writing: No such file", failing(FakeDevice::kOpen, ENOENT));
  expect("cannot be opened for writing: Permission denied", failing(FakeDevice::kOpen, EACCES));
  expect("cannot be opened for writing: Read-only file system", failing(FakeDevice::kOpen, EROFS));
  expect("cannot be opened for writing: in use by another program",
         failing(FakeDevice::kOpen, EBUSY));
  expect("the device is gone", failing(FakeDevice::kOpen, ENODEV));
  expect("is no video device", failing(VIDIOC_QUERYCAP, ENOTTY));
  expect("the device is gone", failing(VIDIOC_QUERYCAP, ENODEV));
  expect("is no video output", [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_CAPTURE; });
  expect("takes frames in several planes only",
         [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_OUTPUT_MPLANE | V4L2_CAP_STREAMING; });
  expect("has no streaming", [](FakeDevice& d) { d.device_caps = V4L2_CAP_VIDEO_OUTPUT; });
  expect("takes none of YUYV", [](FakeDevice& d) { d.formats = {V4L2_PIX_FMT_MJPEG}; });
  expect("takes none of YUYV", [](FakeDevice& d) { d.formats.clear(); });
  expect("takes none of YUYV", [](FakeDevice& d) { d.insists_on_format = V4L2_PIX_FMT_MJPEG; });
  expect("takes none of YUYV", failing(VIDIOC_S_FMT, EINVAL));
  expect("takes frames of 640x4, not of 6x4 (--size)", [](FakeDevice& d) { d.only_width = 640; });
  expect("takes no format: in use by another program", failing(VIDIOC_S_FMT, EBUSY));
  expect("takes no format: Input/output error", failing(VIDIOC_S_FMT, EIO));
  expect("states a frame of 36 bytes in rows of 12, which cannot hold 6x4",
         [](FakeDevice& d) { d.sizeimage_off = 12; });
  expect("the device is gone", failing(VIDIOC_S_PARM, ENODEV));
  expect("gives no buffers: in use by another program", failing(VIDIOC_REQBUFS, EBUSY));
  expect("gives no buffers: Cannot allocate memory", failing(VIDIOC_REQBUFS, ENOMEM));
  expect("gives 0 buffers", [](FakeDevice& d) { d.buffer_count = UINT32_MAX; });
  expect("gives 4000 buffers", [](FakeDevice& d) { d.buffer_count = 4000; });
  expect("says nothing of a buffer: Invalid argument", failing(VIDIOC_QUERYBUF, EINVAL));
  expect("gives a buffer of 47 bytes for frames of 48",
         [](FakeDevice& d) { d.buffer_bytes_off = 1; });
  expect("a buffer cannot be mapped: Cannot allocate memory", failing(FakeDevice::kMap, ENOMEM));
  expect("a buffer cannot be mapped", [](FakeDevice& d) { d.fail(FakeDevice::kMap, ENOMEM, 2); });
}

TEST(V4l2Output, ARateThatADeviceDoesNotKnowIsNoError) {
  FakeDevice device;
  device.fail(VIDIOC_S_PARM, ENOTTY);
  EXPECT_TRUE(open(device).ok());
}

TEST(V4l2Output, SaysWhyADeviceWasLost) {
  const auto expect = [](const std::string& wanted, const auto& change) {
    FakeDevice device;
    auto output = open(device);
    ASSERT_TRUE(output.ok());
    const std::vector<uint8_t> pixels = numbered(48);
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(*(*output)->show(pixels, 100));
    change(device);
    Result<bool> shown = true;
    for (int i = 0; i < 8 && shown.ok(); ++i) shown = (*output)->show(pixels, 100);
    ASSERT_FALSE(shown.ok()) << wanted;
    EXPECT_EQ(shown.status().message(), "/dev/video7: " + wanted);
    EXPECT_EQ(shown.status().code(), StatusCode::kIo);
    output->reset();
    EXPECT_EQ(device.closed, 1);
    EXPECT_EQ(device.mapped, device.unmapped);
  };
  const auto failing = [](unsigned long request, int error) {
    return [=](FakeDevice& d) { d.fail(request, error, 0, true); };
  };
  expect("the device is gone", failing(VIDIOC_DQBUF, ENODEV));
  expect("gave no buffer back: Input/output error", failing(VIDIOC_DQBUF, EIO));
  expect("takes no frame: Input/output error", failing(VIDIOC_QBUF, EIO));
  expect("the device is gone", failing(VIDIOC_QBUF, ENODEV));
  expect("gave back a buffer that there is none of", [](FakeDevice& d) { d.wrong_index = 100; });
  expect("cannot be waited for: Bad file descriptor", [](FakeDevice& d) {
    d.shows = false;
    d.fail(FakeDevice::kPoll, EBADF, 0, true);
  });
  FakeDevice device;
  auto output = open(device);
  device.fail(VIDIOC_STREAMON, EIO);
  EXPECT_EQ((*output)->show(numbered(48), 100).status().message(),
            "/dev/video7: does not start: Input/output error");
}

}  // namespace
}  // namespace figurine::ports::v4l2_output_test
