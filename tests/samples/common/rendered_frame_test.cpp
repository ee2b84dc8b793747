// A frame of every pixel format has room for what the renderer writes, and no more.
#include "samples/common/rendered_frame.h"

#include <gtest/gtest.h>

#include "figurine/renderer.h"

namespace figurine::samples::rendered_frame_test {
namespace {

constexpr ImageSize kSize{34, 18};
constexpr size_t kPixels = size_t(kSize.width_px) * kSize.height_px;
constexpr Camera kCamera{.width_px = kSize.width_px,
                         .height_px = kSize.height_px,
                         .fx_px = 20,
                         .fy_px = 20,
                         .cx_px = 17,
                         .cy_px = 9};

TEST(RenderedFrame, HoldsEveryFormat) {
  const Result<std::unique_ptr<Renderer>> renderer = Renderer::create({});
  ASSERT_TRUE(renderer.ok());
  const struct {
    PixelFormat format;
    size_t bytes;
  } cases[] = {{PixelFormat::kRgba8, 4 * kPixels},   {PixelFormat::kRgbaF32, 16 * kPixels},
               {PixelFormat::kBgra8, 4 * kPixels},   {PixelFormat::kRgb24, 3 * kPixels},
               {PixelFormat::kBgr24, 3 * kPixels},   {PixelFormat::kYuyv, 2 * kPixels},
               {PixelFormat::kNv12, kPixels * 3 / 2}};
  for (const auto& one : cases) {
    RenderedFrame frame(kSize, one.format);
    EXPECT_EQ(
        frame.u8.pixels.size() + frame.f32.pixels.size() * sizeof(float) + frame.packed.size(),
        one.bytes)
        << to_string(one.format);
    const Status drawn =
        (*renderer)->render({.camera = kCamera, .background = {{1, 1, 1}}}, frame.target());
    EXPECT_TRUE(drawn.ok()) << to_string(one.format) << ": " << drawn.message();
  }
}

}  // namespace
}  // namespace figurine::samples::rendered_frame_test
