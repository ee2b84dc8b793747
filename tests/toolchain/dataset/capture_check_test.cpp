// The posed body over masks that were drawn from it fits, over others it does not.
#include "toolchain/dataset/capture_check.h"

#include <gtest/gtest.h>

#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::capture_check_test {
namespace {

using test::TemporaryFolder;

const Body& mannequin() {
  static const body::TexelBody texels = body::make_texel_body(body::make_mannequin(), 64);
  static const Body body = texels.view();
  return body;
}

// A capture whose masks are the body's own outline, moved by shift_px.
CaptureCheck check(uint32_t shift_px, bool blurred) {
  const TemporaryFolder folder;
  test::FolderSettings settings;
  settings.cameras = {1, 2, 3}, settings.frames = {5}, settings.poses = {0};
  test::write_folder(folder, settings);
  const Dataset data = Dataset::open(folder.path(), {.body = &mannequin()});
  std::vector<ports::ImageU8> drawn;
  check_capture(data, mannequin(), 0,
                [&](const ViewCheck&, const ports::ImageU8& picture) { drawn.push_back(picture); });
  EXPECT_EQ(drawn.size(), 3u);
  for (size_t c = 0; c < drawn.size(); ++c) {
    ports::ImageU8 mask(test::kWidth, test::kHeight, 1), image(test::kWidth, test::kHeight, 3);
    for (uint32_t y = 0; y < test::kHeight; ++y) {
      for (uint32_t x = 0; x < test::kWidth; ++x) {
        const bool striped = !(blurred && c == 2) && x % 2 == 0;
        std::fill_n(image.at(x, y), 3, uint8_t(striped ? 255 : 100));
        // Where the body was drawn, red is raised above blue.
        const uint8_t* p = drawn[c].at(x, y);
        if (p[0] > p[2] + 20 || (p[0] == 255 && p[1] == 255))
          *mask.at((x + shift_px) % test::kWidth, y) = 255;
      }
    }
    test::write_bytes(data.mask_path(0, c), ports::encode_png(mask).value());
    test::write_bytes(data.image_path(0, c), ports::encode_jpeg(image, 95).value());
  }
  return check_capture(data, mannequin(), 0, nullptr);
}

TEST(CaptureCheck, ABodyLiesOnItsOwnOutline) {
  const CaptureCheck found = check(0, false);
  ASSERT_EQ(found.cameras.size(), 3u);
  for (const CameraCheck& camera : found.cameras) {
    EXPECT_GT(camera.mean.overlap, 0.7) << "of 24 rows: bones are drawn a pixel too wide";
    EXPECT_GT(camera.mean.joints_in_mask, 0.9);
    EXPECT_EQ(camera.trouble, "");
  }
  EXPECT_EQ(found.misfits(), 0u);
}

TEST(CaptureCheck, AMaskBesideTheBodyIsFound) {
  const CaptureCheck found = check(12, false);
  EXPECT_EQ(found.misfits(), 3u);
  EXPECT_GT(found.cameras[0].mean.joint_distance_px, 1);
}

TEST(CaptureCheck, ABlurredCameraIsSaidAndIsNoMisfit) {
  const CaptureCheck found = check(0, true);
  EXPECT_NE(found.cameras[2].trouble.find("blurred"), std::string::npos);
  EXPECT_EQ(found.misfits(), 0u);
}

}  // namespace
}  // namespace figurine::dataset::capture_check_test
