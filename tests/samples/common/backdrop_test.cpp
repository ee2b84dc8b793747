// A camera behind figures: its newest picture covers the frame, figures lie over it as they lie
// over a colour, in every format that live pictures have; when it is lost one line says so, and the
// colour is there again.
#include "samples/common/backdrop.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <vector>

#include "ports/v4l2/fake_device.h"
#include "samples/common/scene.h"
#include "samples/program.h"

namespace figurine::samples::backdrop_test {
namespace {

std::mutex said_mutex;
std::vector<std::string> said_lines;
void note(const std::string& line) {
  const std::lock_guard lock(said_mutex);
  said_lines.push_back(line);
}

template <class Condition>
bool soon(Condition holds) {
  for (int i = 0; i < 2000; ++i) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

TEST(Backdrop, CoversTheFrameUntilTheCameraIsLost) {
  said_lines.clear();
  tests::FakeDevice device;
  device.become_camera();
  device.only_width = 8;  // of whatever is asked for
  // Left half black, right half white: 8 x 2, of which a square frame shows the middle.
  std::vector<uint8_t> row;
  for (const uint8_t luma : {16, 16, 235, 235}) row.insert(row.end(), {luma, 128, luma, 128});
  std::vector<uint8_t> codes = row;
  codes.insert(codes.end(), row.begin(), row.end());
  device.given.push_back({codes});
  device.fail(VIDIOC_DQBUF, ENODEV, 3000, true);
  auto backdrop = Backdrop::open("/dev/video7", {.size = {2, 2}, .say = note, .system = &device});
  ASSERT_TRUE(backdrop.ok()) << backdrop.status().message();
  std::shared_ptr<const ports::ImageU8> seen;
  ASSERT_TRUE(soon([&] {
    const auto newest = (*backdrop)->newest();
    if (newest) seen = newest;
    return (*backdrop)->counts().lost;
  }));
  EXPECT_EQ((*backdrop)->counts().pictures, 1u);
  EXPECT_FALSE((*backdrop)->newest());
  if (seen) {  // unless it was lost before anybody looked
    EXPECT_EQ(seen->width_px, 2u);
    EXPECT_EQ(seen->at(0, 0)[0], 0);
    EXPECT_EQ(seen->at(1, 1)[2], 255);
  }
  backdrop->reset();
  const std::lock_guard lock(said_mutex);
  ASSERT_EQ(said_lines.size(), 1u);
  EXPECT_EQ(said_lines[0],
            "/dev/video7: the device is gone; the background colour takes its place");
}

TEST(Backdrop, SaysWhyThereIsNone) {
  tests::FakeDevice device;  // an output
  const auto backdrop =
      Backdrop::open("/dev/video7", {.size = {2, 2}, .say = note, .system = &device});
  EXPECT_EQ(backdrop.status().message(), "/dev/video7: is no camera");
}

// By hand: alpha 0 is the ground, 255 the figure, 51 a fifth of it.
TEST(Compose, LaysFiguresOverThePicture) {
  RenderedFrame figures({3, 1}, PixelFormat::kRgba8), frame({3, 1}, PixelFormat::kRgb24);
  figures.u8.pixels = {9, 9, 9, 0, 200, 100, 0, 255, 250, 0, 100, 51};
  ports::ImageU8 behind(3, 1, 3), scratch;
  behind.pixels = {10, 20, 30, 1, 2, 3, 50, 100, 200};
  compose(figures, &behind, {0, 0, 0}, YcbcrMatrix::kBt601, scratch, frame);
  EXPECT_EQ(frame.u8.pixels, (std::vector<uint8_t>{10, 20, 30, 200, 100, 0, 90, 80, 180}));
  compose(figures, nullptr, {1, 0.5f, 0}, YcbcrMatrix::kBt601, scratch, frame);
  EXPECT_EQ(frame.u8.pixels, (std::vector<uint8_t>{255, 128, 0, 200, 100, 0, 254, 102, 20}));
}

// What the renderer itself makes of figures over a colour, to the rounding of eight bits of alpha.
TEST(Compose, OverAColourItIsWhatTheRendererDraws) {
  tests::TestFolder folder;
  tests::write_test_packages(folder);
  auto scene = Scene::load({.avatars = {folder.path("avatar.fgn")}});
  ASSERT_TRUE(scene.ok());
  auto renderer = Renderer::create({});
  ASSERT_TRUE(renderer.ok());
  ASSERT_TRUE(scene->add_to(**renderer, std::nullopt).ok());
  const Camera camera = scene->avatar(0).avatar.golden.camera;
  const ImageSize size{camera.width_px, camera.height_px};
  const std::array<float, 3> colour{0.2f, 0.7f, 0.4f};
  RenderedFrame figures(size, PixelFormat::kRgba8);
  const Frame seen{.camera = camera, .avatars = scene->pose(0)};
  ASSERT_TRUE((*renderer)->render(seen, figures.target()).ok());
  ports::ImageU8 scratch;
  for (const PixelFormat format : {PixelFormat::kRgba8, PixelFormat::kRgb24, PixelFormat::kBgr24,
                                   PixelFormat::kYuyv, PixelFormat::kNv12}) {
    RenderedFrame wanted(size, format), frame(size, format);
    ImageTarget target = wanted.target();
    target.matrix = YcbcrMatrix::kBt601;
    Frame on_colour = seen;
    on_colour.background = colour;
    ASSERT_TRUE((*renderer)->render(on_colour, target).ok());
    compose(figures, nullptr, colour, YcbcrMatrix::kBt601, scratch, frame);
    const bool plain = format == PixelFormat::kRgba8 || format == PixelFormat::kRgb24;
    const std::vector<uint8_t>& a = plain ? wanted.u8.pixels : wanted.packed;
    const std::vector<uint8_t>& b = plain ? frame.u8.pixels : frame.packed;
    ASSERT_EQ(a.size(), b.size());
    int largest = 0;
    for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(int{a[i]} - b[i]));
    EXPECT_LE(largest, 2) << to_string(format);
  }
}

}  // namespace
}  // namespace figurine::samples::backdrop_test
