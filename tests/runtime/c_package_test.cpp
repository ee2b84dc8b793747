// Packages through C that are opened for drawing alone.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <vector>

#include "figurine.h"
#include "runtime/test_packages.h"

namespace figurine::tests {
namespace {

// Damage where drawing never looks is no hindrance; everywhere else it is found.
TEST(CPackage, OpensForDrawingWhatDrawingTakes) {
  std::ifstream file(FIGURINE_SOURCE_DIR "/samples/packages/person.fgn", std::ios::binary);
  std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  const AlignedBytes whole(std::as_bytes(std::span(bytes)));
  const Result<Package> sound = Package::open(whole.bytes(), "sound");
  ASSERT_TRUE(sound.ok()) << sound.status().message();
  const auto* picture = reinterpret_cast<const std::byte*>(sound->avatar().golden.png.data());
  bytes[static_cast<size_t>(picture - whole.bytes().data()) + 40] ^= 1;
  const AlignedBytes bent(std::as_bytes(std::span(bytes)));
  fig_package_options options = fig_default_package_options();
  fig_package package{};
  EXPECT_EQ(fig_package_open(bent.bytes().data(), bent.bytes().size(), &options, &package),
            FIG_CORRUPT);
  EXPECT_NE(std::string(fig_last_message()).find("golden.png"), std::string::npos)
      << fig_last_message();
  options.for_drawing = 1;
  ASSERT_EQ(fig_package_open(bent.bytes().data(), bent.bytes().size(), &options, &package), FIG_OK)
      << fig_last_message();
  fig_package_info info = fig_default_package_info();
  EXPECT_EQ(fig_package_get_info(package, &info), FIG_OK);
  EXPECT_EQ(info.holds_q8, 1);
  EXPECT_EQ(info.holds_f32, 0) << "fixed point alone where there are both";
  EXPECT_EQ(fig_package_close(package), FIG_OK);
}

}  // namespace
}  // namespace figurine::tests
