// The BVH reader on small files, sound and hostile.
#include "ports/motion/bvh.h"

#include "gtest/gtest.h"

namespace figurine::ports::bvh_test {
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

Bvh sound(const std::string& text) {
  Result<Bvh> bvh = parse_bvh(text, "a.bvh");
  EXPECT_TRUE(bvh.ok()) << bvh.status().message();
  return bvh.ok() ? std::move(bvh).value() : Bvh{};
}

std::string error(std::string_view text) {
  const Result<Bvh> bvh = parse_bvh(text, "a.bvh");
  return bvh.ok() ? "" : bvh.status().message();
}

TEST(Bvh, ReadsHierarchyAndFrames) {
  const Bvh bvh = sound(kSound);
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

TEST(Bvh, EveryPrefixIsRefusedOrSaysWhatItLacks) {
  const size_t whole = kSound.find_last_of('0') + 1, first = kSound.find("4 5 6");
  for (size_t length = 0; length < whole - 1; ++length) {
    const Result<Bvh> bvh = parse_bvh(std::string_view(kSound).substr(0, length), "a.bvh");
    if (!bvh.ok()) continue;
    // The first frame is whole: a recorder that was killed later.
    EXPECT_GE(length, first - 2);  // a single frame is believed
    EXPECT_EQ(bvh->frame_count, 1u);
    EXPECT_EQ(bvh->values.size(), bvh->channel_count);
    EXPECT_EQ(bvh->note, "the header says 2 frames, the file holds 1");
  }
  EXPECT_EQ(error(std::string_view(kSound).substr(0, whole)), "");
}

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kSound;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Bvh, NamesLineAndReason) {
  EXPECT_EQ(error(replaced("-2.5", "down")), "a.bvh: line 8: \"down\" is no number");
  EXPECT_EQ(error(replaced("-2.5", "nan")), "a.bvh: line 8: \"nan\" is out of range");
  EXPECT_EQ(error(replaced("-2.5", "1e300")), "a.bvh: line 8: \"1e300\" is out of range");
  EXPECT_EQ(error(replaced("Frames: 2", "Frames: 1")),
            "a.bvh: line 20: more values than the 1 frames that the header says");
  EXPECT_EQ(error(replaced("5 6 0", "5 60")),
            "a.bvh: line 20: 8 values, the hierarchy has 9 channels");
  EXPECT_EQ(error(replaced("-40 50", "-40-50")), "a.bvh: line 20: \"-40-50\" is no number");
  EXPECT_NE(
      error(replaced("Frames: 2", "Frames: 18446744073709551615")).find("more than 2^26 values"),
      std::string::npos);
  EXPECT_NE(error(replaced("Frames: 2", "Frames: -2")).find("is no count"), std::string::npos);
  EXPECT_NE(error(replaced("Frames: 2", "Frames: 0")).find("no frames"), std::string::npos);
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
  EXPECT_NE(error(deep).find("deeper than 64"), std::string::npos);
  std::string wide = "HIERARCHY ROOT a {";
  for (int i = 0; i < 2000; ++i) wide += " JOINT a { }";
  EXPECT_NE(error(wide).find("more than 1024 joints"), std::string::npos);
}

TEST(Bvh, IsReadAsPeopleHaveIt) {
  const Bvh plain = sound(kSound);
  const auto same = [&](const std::string& text) {
    const Bvh bvh = sound(text);
    EXPECT_EQ(bvh.values, plain.values);
    EXPECT_EQ(bvh.frame_time_s, plain.frame_time_s);
    ASSERT_EQ(bvh.joints.size(), 2u);
    EXPECT_EQ(bvh.joints[1].name, "Knee");
    EXPECT_EQ(bvh.joints[1].offset, plain.joints[1].offset);
    EXPECT_EQ(bvh.note, "");
  };
  same("\xEF\xBB\xBF" + kSound);
  same(replaced("Frames: 2", "Frames:2"));
  same(replaced("Frames: 2", "FRAMES :\t2"));
  same(replaced("Frame Time: .0083333", "Frame Time:.0083333"));
  same(replaced("JOINT Knee\n  {", "JOINT Knee {"));
  same(replaced("JOINT Knee\n  {", "Joint Knee{"));
  same(replaced("End Site", "End site ankle_end"));
  same(replaced("HIERARCHY", "Hierarchy"));
  same(replaced("1 2 3 0 0 0", "1e0  2.0E+0\t+3 0 -0 0.0"));
  same(replaced("4 5 6", "\n\n4 5 6"));
  same(replaced("0 0 0 10 20 30", "0 0 0\n10 20\n30"));  // wrapped
  std::string dos = kSound, mac = kSound;
  for (size_t at = 0; (at = dos.find('\n', at)) != std::string::npos; at += 2)
    dos.replace(at, 1, "\r\n");
  std::replace(mac.begin(), mac.end(), '\n', '\r');
  same(dos);
  same(mac);
  EXPECT_EQ(sound(replaced("JOINT Knee", "JOINT  Left Knee 2 ")).joints[1].name, "Left Knee 2");
  EXPECT_EQ(error("\xFF\xFEH"), "a.bvh: line 1: UTF-16 text: save it as UTF-8 or ASCII");
}

TEST(Bvh, AFrameTimeThatCannotBeIsNone) {
  for (const char* time : {"0", "33", "1e-5"})
    EXPECT_EQ(sound(replaced(".0083333", time)).frame_time_s, 0) << time;
}

TEST(Bvh, SeveralRootsAreRead) {
  const std::string two =
      replaced("MOTION", "ROOT Other { OFFSET 1 2 3 CHANNELS 1 Yrotation }\nMOTION");
  EXPECT_EQ(error(two),
            "a.bvh: line 20: 9 values, the hierarchy has 10 channels (read on over lines: line 22: "
            "the file ends early)");
  std::string whole = two;
  whole.replace(whole.find("20 30\n"), 6, "20 30 90\n");
  whole.replace(whole.find("+60\n"), 4, "+60 90\n");
  EXPECT_EQ(sound(whole).joints[2].parent, -1);
  EXPECT_EQ(sound(whole).values[19], 90);
}

}  // namespace
}  // namespace figurine::ports::bvh_test
