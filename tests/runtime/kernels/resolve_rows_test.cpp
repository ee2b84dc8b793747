// Bytes and floats of known tiles.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "runtime/src/kernels/table.h"

namespace figurine::resolve_rows_test {
namespace {

using kernels::TilePixels;

class ResolveRows : public ::testing::TestWithParam<Isa> {
 protected:
  ResolveRows() {
    for (float& transmittance : pixels_->transmittance) transmittance = 1;
  }
  void set(int i, float red, float green, float blue, float transmittance) {
    pixels_->red[i] = red, pixels_->green[i] = green, pixels_->blue[i] = blue;
    pixels_->transmittance[i] = transmittance;
  }
  // The first `width` pixels of the first row.
  std::vector<uint8_t> bytes(int32_t width, const float* background) {
    std::vector<uint8_t> out(static_cast<size_t>(width) * 4, 77);
    run(width, background, kernels::kResolveRgba8, out.data());
    return out;
  }
  std::vector<float> floats(int32_t width, const float* background) {
    std::vector<float> out(static_cast<size_t>(width) * 4, 77);
    run(width, background, kernels::kResolveRgbaF32, reinterpret_cast<uint8_t*>(out.data()));
    return out;
  }

 private:
  void run(int32_t width, const float* background, kernels::ResolveFormat format, uint8_t* out) {
    (*kernels_for(GetParam()))
        ->resolve_rows({.pixels = pixels_.get(),
                        .first_row = 0,
                        .rows = 1,
                        .width = width,
                        .background = background,
                        .format = format,
                        .out = out,
                        .stride_bytes = 0});
  }

  std::unique_ptr<TilePixels> pixels_ = std::make_unique<TilePixels>();
};

TEST_P(ResolveRows, StraightColourOfAPremultipliedOne) {
  set(0, 0.25f, 0.125f, 0, 0.5f);
  EXPECT_EQ(bytes(2, nullptr), (std::vector<uint8_t>{128, 64, 0, 128, 0, 0, 0, 0}));
  EXPECT_EQ(floats(1, nullptr), (std::vector<float>{0.5f, 0.25f, 0, 0.5f}));
}

TEST_P(ResolveRows, OverABackgroundItIsOpaque) {
  constexpr float kBackground[3] = {1, 0.5f, 0};
  set(0, 0.25f, 0.125f, 0, 0.5f);
  EXPECT_EQ(bytes(2, kBackground), (std::vector<uint8_t>{191, 96, 0, 255, 255, 128, 0, 255}));
  EXPECT_EQ(floats(1, kBackground), (std::vector<float>{0.75f, 0.375f, 0, 1}));
}

TEST_P(ResolveRows, AStoppedPixelsSignIsNotItsLight) {
  set(0, 0.99f, 0, 0, -0.01f);
  EXPECT_EQ(bytes(1, nullptr), (std::vector<uint8_t>{255, 0, 0, 252}));
}

TEST_P(ResolveRows, BytesRoundToNearestAndClamp) {
  constexpr float kBlack[3] = {0, 0, 0};
  set(0, 1.5f, -0.5f, std::numeric_limits<float>::quiet_NaN(), 0);
  set(1, 0.501f / 255, 0.499f / 255, 254.501f / 255, 0);
  EXPECT_EQ(bytes(2, kBlack), (std::vector<uint8_t>{255, 0, 0, 255, 1, 0, 255, 255}));
}

TEST_P(ResolveRows, FloatsAreNeitherRoundedNorClamped) {
  constexpr float kBlack[3] = {0, 0, 0};
  set(0, 1.5f, -0.5f, 0.1f, 0);
  EXPECT_EQ(floats(1, kBlack), (std::vector<float>{1.5f, -0.5f, 0.1f, 1}));
}

INSTANTIATE_TEST_SUITE_P(Isas, ResolveRows,
                         ::testing::ValuesIn(supported_isas().begin(), supported_isas().end()),
                         [](const auto& of) { return std::string(to_string(of.param)); });

}  // namespace
}  // namespace figurine::resolve_rows_test
