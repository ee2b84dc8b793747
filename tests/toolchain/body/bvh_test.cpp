// The BVH reader on small files, sound and hostile.
#include "toolchain/body/bvh.h"

#include "gtest/gtest.h"
#include "toolchain/body/test_files.h"

namespace figurine::body::bvh_test {
namespace {

const std::string kSound = R"(HIERARCHY
ROOT Hips
{
  OFFSET 0 1 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Knee
  {
    OFFSET 0 -2.5 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0 -1e0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .0083333
1 2 3 0 0 0 10 20 30
4 5 6 0 0 0 -40 50 +60
)";

TEST(Bvh, ReadsHierarchyAndFrames) {
  const Bvh bvh = parse_bvh(kSound, "a.bvh");
  ASSERT_EQ(bvh.joints.size(), 2u);
  EXPECT_EQ(bvh.joints[1].name, "Knee");
  EXPECT_EQ(bvh.joints[1].parent, 0);
  EXPECT_EQ(bvh.joints[1].first_channel, 6u);
  EXPECT_EQ(bvh.joints[1].offset[1], -2.5);
  EXPECT_TRUE(bvh.joints[1].has_end);
  EXPECT_EQ(bvh.joints[0].channels[3], BvhChannel::kZRotation);
  EXPECT_EQ(bvh.frame_count, 2u);
  EXPECT_NEAR(1 / bvh.frame_time_s, 120, 0.01);
  EXPECT_EQ(bvh.values[9 + 8], 60);
  EXPECT_EQ(bvh.find("Knee"), 1);
  EXPECT_EQ(bvh.find("Elbow"), -1);
}

TEST(Bvh, EveryPrefixIsRefusedOrWhole) {
  const size_t whole = kSound.find_last_of('0') + 1;
  for (size_t length = 0; length < whole - 1; ++length) {
    EXPECT_THROW(parse_bvh(std::string_view(kSound).substr(0, length), "a.bvh"), InputError)
        << length;
  }
  EXPECT_NO_THROW(parse_bvh(std::string_view(kSound).substr(0, whole), "a.bvh"));
}

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kSound;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Bvh, NamesLineAndReason) {
  const auto error = [](const std::string& text) {
    return test::input_error([&] { parse_bvh(text, "a.bvh"); });
  };
  EXPECT_EQ(error(replaced("-2.5", "down")), "a.bvh: line 8: \"down\" is no number");
  EXPECT_EQ(error(replaced("-2.5", "nan")), "a.bvh: line 8: \"nan\" is out of range");
  EXPECT_EQ(error(replaced("-2.5", "1e300")), "a.bvh: line 8: \"1e300\" is out of range");
  EXPECT_NE(error(replaced("Frames: 2", "Frames: 3")).find("the file ends early"),
            std::string::npos);
  EXPECT_NE(error(replaced("Frames: 2", "Frames: 1")).find("more values than 1 frames"),
            std::string::npos);
  EXPECT_NE(
      error(replaced("Frames: 2", "Frames: 18446744073709551615")).find("more than 2^26 values"),
      std::string::npos);
  EXPECT_NE(error(replaced("Frames: 2", "Frames: -2")).find("is no count"), std::string::npos);
  EXPECT_NE(error(replaced("Frames: 2", "Frames: 0")).find("no frames"), std::string::npos);
  EXPECT_NE(error(replaced(".0083333", "0")).find("frame time"), std::string::npos);
  EXPECT_NE(error(replaced("CHANNELS 3", "CHANNELS 7")).find("more than 6 channels"),
            std::string::npos);
  EXPECT_NE(error(replaced("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation"))
                .find("\"Wrotation\" is no channel"),
            std::string::npos);
  EXPECT_NE(error("HIERARCHY ROOT").find("the file ends early"), std::string::npos);
  EXPECT_NE(error(std::string(100000, 'x')).size(), 100000u);  // long words are cut in messages
}

TEST(Bvh, DepthAndCountsAreLimited) {
  std::string deep = "HIERARCHY ROOT a {";
  for (int i = 0; i < 100000; ++i) deep += " JOINT a {";
  EXPECT_NE(test::input_error([&] { parse_bvh(deep, "a.bvh"); }).find("deeper than 64"),
            std::string::npos);
  std::string wide = "HIERARCHY ROOT a {";
  for (int i = 0; i < 2000; ++i) wide += " JOINT a { }";
  EXPECT_NE(test::input_error([&] { parse_bvh(wide, "a.bvh"); }).find("more than 1024 joints"),
            std::string::npos);
}

}  // namespace
}  // namespace figurine::body::bvh_test
