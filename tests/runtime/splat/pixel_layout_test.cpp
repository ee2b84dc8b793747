// Every pixel format, to the bit, against the RGBA8 picture of the same frame converted by a plain
// loop; and every target that a format cannot be written to is refused before anything is drawn.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "figurine/ycbcr.h"
#include "runtime/splat_scene.h"

namespace figurine::tests::pixel_layout_test {
namespace {

constexpr uint8_t kUntouched = 0xA5;

// Pixels with room between rows and around planes that must stay as it was.
struct Picture {
  PixelFormat format;
  uint32_t width, height;
  size_t row_bytes = 0, chroma_row_bytes = 0;  // that are written
  size_t stride = 0, chroma_stride = 0;
  std::vector<uint8_t> plane, chroma;
  YcbcrMatrix matrix = YcbcrMatrix::kBt709;

  Picture(PixelFormat pixel_format, uint32_t width_px, uint32_t height_px)
      : format(pixel_format), width(width_px), height(height_px) {
    row_bytes = bytes_per_pixel() * width;
    stride = row_bytes + 13;
    plane.assign(stride * height, kUntouched);
    if (format != PixelFormat::kNv12) return;
    chroma_row_bytes = width;
    chroma_stride = width + 7;
    chroma.assign(chroma_stride * (height / 2), kUntouched);
  }
  size_t bytes_per_pixel() const {
    switch (format) {
      case PixelFormat::kRgba8:
      case PixelFormat::kBgra8:
        return 4;
      case PixelFormat::kRgb24:
      case PixelFormat::kBgr24:
        return 3;
      case PixelFormat::kYuyv:
        return 2;
      case PixelFormat::kNv12:
        return 1;
      case PixelFormat::kRgbaF32:
        break;
    }
    ADD_FAILURE() << "not a format of bytes";
    return 1;
  }
  ImageTarget target() {
    return {.pixels = plane.data(),
            .stride_bytes = stride,
            .format = format,
            .chroma = chroma.empty() ? nullptr : chroma.data(),
            .chroma_stride_bytes = chroma_stride,
            .matrix = matrix};
  }
  uint8_t* row(uint32_t y) { return &plane[y * stride]; }
  const uint8_t* row(uint32_t y) const { return &plane[y * stride]; }
};

struct Rgb {
  uint32_t r, g, b;
};
Rgb operator+(const Rgb& a, const Rgb& b) { return {a.r + b.r, a.g + b.g, a.b + b.b}; }

template <YcbcrMatrix matrix>
void convert_to_ycbcr(const Picture& rgba, Picture& out) {
  const auto at = [&](uint32_t x, uint32_t y) {
    const uint8_t* p = rgba.row(y) + 4 * x;
    return Rgb{p[0], p[1], p[2]};
  };
  const bool yuyv = out.format == PixelFormat::kYuyv;
  for (uint32_t y = 0; y < out.height; ++y) {
    for (uint32_t x = 0; x < out.width; ++x) {
      const Rgb p = at(x, y);
      out.row(y)[(yuyv ? 2 : 1) * x] = luma_code<matrix>(p.r, p.g, p.b);
    }
  }
  for (uint32_t y = 0; y < out.height; y += yuyv ? 1 : 2) {
    for (uint32_t x = 0; x < out.width; x += 2) {
      Rgb sum = at(x, y) + at(x + 1, y);
      if (yuyv) {
        const ChromaCodes codes = chroma_codes<matrix, 2>(sum.r, sum.g, sum.b);
        out.row(y)[2 * x + 1] = codes.cb;
        out.row(y)[2 * x + 3] = codes.cr;
      } else {
        sum = sum + at(x, y + 1) + at(x + 1, y + 1);
        const ChromaCodes codes = chroma_codes<matrix, 4>(sum.r, sum.g, sum.b);
        out.chroma[y / 2 * out.chroma_stride + x] = codes.cb;
        out.chroma[y / 2 * out.chroma_stride + x + 1] = codes.cr;
      }
    }
  }
}

// The plain loop.
void convert(const Picture& rgba, Picture& out) {
  if (out.format == PixelFormat::kYuyv || out.format == PixelFormat::kNv12) {
    out.matrix == YcbcrMatrix::kBt601 ? convert_to_ycbcr<YcbcrMatrix::kBt601>(rgba, out)
                                      : convert_to_ycbcr<YcbcrMatrix::kBt709>(rgba, out);
    return;
  }
  const bool bgr = out.format == PixelFormat::kBgra8 || out.format == PixelFormat::kBgr24;
  const size_t size = out.bytes_per_pixel();
  for (uint32_t y = 0; y < out.height; ++y) {
    for (uint32_t x = 0; x < out.width; ++x) {
      for (size_t c = 0; c < size; ++c)
        out.row(y)[size * x + c] = rgba.row(y)[4 * x + (bgr && c < 3 ? 2 - c : c)];
    }
  }
}

class PixelFormats : public testing::TestWithParam<PixelFormat> {
 protected:
  // Holds GetParam() of one size and background against RGBA8. Two threads: tiles come in any
  // order.
  void expect_equal(uint32_t width, uint32_t height,
                    const std::optional<std::array<float, 3>>& background,
                    YcbcrMatrix matrix = YcbcrMatrix::kBt709) {
    const std::unique_ptr<Renderer> renderer = make_renderer(2);
    const Scene scene = make_random_scene(300, 1, 7);
    const GaussianView view = scene.view();
    const Frame frame{.camera = front_camera(width, height, 40),
                      .gaussians = {&view, 1},
                      .background = background};
    Picture rgba(PixelFormat::kRgba8, width, height);
    Picture drawn(GetParam(), width, height), expected(GetParam(), width, height);
    drawn.matrix = expected.matrix = matrix;
    ASSERT_TRUE(renderer->render(frame, rgba.target()).ok());
    const Status status = renderer->render(frame, drawn.target());
    ASSERT_TRUE(status.ok()) << status.message();
    convert(rgba, expected);
    EXPECT_EQ(drawn.plane, expected.plane) << width << "x" << height;
    EXPECT_EQ(drawn.chroma, expected.chroma) << width << "x" << height;
  }
};

TEST_P(PixelFormats, AreRgba8Converted) {
  constexpr std::array<float, 3> kBackground{0.86f, 0.3f, 0.1f};
  expect_equal(64, 48, kBackground);
  expect_equal(50, 38, kBackground);  // tiles cut on both sides
  expect_equal(2, 2, kBackground);
  expect_equal(50, 38, kBackground, YcbcrMatrix::kBt601);
}

TEST_P(PixelFormats, ShowTheBackgroundWhereNothingIs) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Frame frame{.camera = front_camera(36, 20, 40), .background = {{0.25f, 0.5f, 1.0f}}};
  Picture rgba(PixelFormat::kRgba8, 36, 20);
  Picture drawn(GetParam(), 36, 20), expected(GetParam(), 36, 20);
  ASSERT_TRUE(renderer->render(frame, rgba.target()).ok());
  ASSERT_TRUE(renderer->render(frame, drawn.target()).ok());
  convert(rgba, expected);
  EXPECT_EQ(drawn.plane, expected.plane);
  EXPECT_EQ(drawn.chroma, expected.chroma);
}

INSTANTIATE_TEST_SUITE_P(All, PixelFormats,
                         testing::Values(PixelFormat::kRgba8, PixelFormat::kBgra8,
                                         PixelFormat::kRgb24, PixelFormat::kBgr24,
                                         PixelFormat::kYuyv, PixelFormat::kNv12),
                         [](const auto& of) { return std::string(to_string(of.param)); });

TEST(PixelFormatsOdd, PlainOnesTakeOddSizesAndBgraKeepsAlpha) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Scene scene = make_random_scene(100, 0, 3);
  const GaussianView view = scene.view();
  for (const PixelFormat format : {PixelFormat::kBgra8, PixelFormat::kRgb24, PixelFormat::kBgr24}) {
    Frame frame{.camera = front_camera(33, 17, 20), .gaussians = {&view, 1}};
    if (format != PixelFormat::kBgra8) frame.background = {{1, 1, 0}};
    Picture rgba(PixelFormat::kRgba8, 33, 17), drawn(format, 33, 17), expected(format, 33, 17);
    ASSERT_TRUE(renderer->render(frame, rgba.target()).ok());
    ASSERT_TRUE(renderer->render(frame, drawn.target()).ok());
    convert(rgba, expected);
    EXPECT_EQ(drawn.plane, expected.plane) << to_string(format);
  }
}

// The message of a refusal; nothing may have been written.
std::string refusal(uint32_t width, uint32_t height, PixelFormat format, bool background,
                    const auto& spoil) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  Frame frame{.camera = front_camera(width, height, 40)};
  if (background) frame.background = {{0, 0, 0}};
  Picture picture(format, width, height);
  ImageTarget target = picture.target();
  spoil(target, picture);
  const Status status = renderer->render(frame, target);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << to_string(format);
  EXPECT_EQ(picture.plane, std::vector<uint8_t>(picture.plane.size(), kUntouched));
  EXPECT_EQ(picture.chroma, std::vector<uint8_t>(picture.chroma.size(), kUntouched));
  return status.message();
}

TEST(PixelFormatsRefuse, OddSizesWherePixelsShareChroma) {
  const auto keep = [](ImageTarget&, Picture&) {};
  EXPECT_EQ(refusal(33, 16, PixelFormat::kYuyv, true, keep),
            "image: yuyv needs an even width, not 33");
  EXPECT_EQ(refusal(33, 16, PixelFormat::kNv12, true, keep),
            "image: nv12 needs an even width, not 33");
  EXPECT_EQ(refusal(32, 17, PixelFormat::kNv12, true, keep),
            "image: nv12 needs an even height, not 17");
}

TEST(PixelFormatsRefuse, PicturesWithoutAlphaOverNothing) {
  for (const PixelFormat format :
       {PixelFormat::kRgb24, PixelFormat::kBgr24, PixelFormat::kYuyv, PixelFormat::kNv12}) {
    EXPECT_EQ(refusal(32, 16, format, false, [](ImageTarget&, Picture&) {}),
              std::string("image: ") + to_string(format) + " has no alpha and needs a background");
  }
}

TEST(PixelFormatsRefuse, ShortRowsAndUnsoundPlanes) {
  for (const PixelFormat format : {PixelFormat::kBgra8, PixelFormat::kRgb24, PixelFormat::kBgr24,
                                   PixelFormat::kYuyv, PixelFormat::kNv12}) {
    const auto shorten = [](ImageTarget& t, Picture& p) { t.stride_bytes = p.row_bytes - 1; };
    EXPECT_NE(refusal(32, 16, format, true, shorten).find("too short for 32 pixels"),
              std::string::npos);
  }
  const auto nv12 = [](const auto& spoil) {
    return refusal(32, 16, PixelFormat::kNv12, true, spoil);
  };
  EXPECT_EQ(nv12([](ImageTarget& t, Picture&) { t.chroma = nullptr; }),
            "image: nv12 needs a plane of chroma");
  EXPECT_EQ(nv12([](ImageTarget& t, Picture&) { t.chroma_stride_bytes = 31; }),
            "image: chroma rows of 31 bytes are too short for 32 pixels");
  EXPECT_EQ(nv12([](ImageTarget& t, Picture& p) { t.chroma = p.row(15); }),
            "image: the plane of chroma lies in the plane of luma");
  EXPECT_EQ(nv12([](ImageTarget& t, Picture&) { t.matrix = YcbcrMatrix(7); }),
            "image: unknown matrix of colours");
}

// One allocation of a camera driver: luma, and chroma right behind it.
TEST(PixelFormatsNv12, ChromaMayFollowLumaAtOnce) {
  const std::unique_ptr<Renderer> renderer = make_renderer();
  const Frame frame{.camera = front_camera(32, 16, 40), .background = {{1, 0, 0}}};
  std::vector<uint8_t> memory(32 * 16 * 3 / 2, 0);
  ASSERT_TRUE(renderer
                  ->render(frame, {.pixels = memory.data(),
                                   .stride_bytes = 32,
                                   .format = PixelFormat::kNv12,
                                   .chroma = memory.data() + 32 * 16,
                                   .chroma_stride_bytes = 32})
                  .ok());
  EXPECT_EQ(memory.front(), 63);  // BT.709's red
  EXPECT_EQ(memory[32 * 16], 102);
  EXPECT_EQ(memory.back(), 240);
}

}  // namespace
}  // namespace figurine::tests::pixel_layout_test
