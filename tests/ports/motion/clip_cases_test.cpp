// tests/data/cases: clips as people have them, each against what its what.txt says is right, on the
// shipped body.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "ports/motion/motion_files.h"

namespace figurine::ports::clip_cases_test {
namespace {

using tests::bone;
using tests::case_path;
using tests::joints_of;
using tests::shipped_body;

struct Read {
  MotionClip clip;
  RetargetReport report;
  bool says(const std::string& words) const {
    return report.summary.find(words) != std::string::npos;
  }
};

std::string file_of(const std::string& name) {
  for (const char* extension : {"bvh", "glb", "npz"}) {
    const std::string path = case_path(name + "/in." + extension);
    if (MappedFile::open(path).ok()) return path;
  }
  return "";
}

Read read_case(const std::string& name, const RetargetOptions& options = {}) {
  Read out;
  Result<MotionClip> clip = read_clip(file_of(name), shipped_body(), options, &out.report);
  EXPECT_TRUE(clip.ok()) << clip.status().message();
  if (clip.ok()) out.clip = std::move(clip).value();
  return out;
}

std::string error_of(const std::string& name, const RetargetOptions& options = {}) {
  const Result<MotionClip> clip = read_clip(file_of(name), shipped_body(), options);
  return clip.ok() ? "" : clip.status().message();
}

// Largest difference of any joint's place, metres.
double difference(const MotionClip& a, const MotionClip& b) {
  EXPECT_EQ(a.frame_count, b.frame_count);
  double largest = 0;
  for (uint32_t f = 0; f < std::min(a.frame_count, b.frame_count); ++f) {
    const auto one = joints_of(shipped_body(), a, f), other = joints_of(shipped_body(), b, f);
    for (size_t j = 0; j < kJointCount; ++j) largest = std::max(largest, length(one[j] - other[j]));
  }
  return largest;
}

// Upright in every frame, the first step left out or not, arms that hang, and a way along +z.
void expect_a_walk(const MotionClip& clip, double path_m, uint32_t hanging_from = 0) {
  ASSERT_GT(clip.frame_count, 2u);
  for (uint32_t f = 0; f < clip.frame_count; ++f) {
    const auto joints = joints_of(shipped_body(), clip, f);
    EXPECT_GT(bone(joints, kPelvis, kNeck).y, 0.97) << f;
    EXPECT_GT(bone(joints, kNeck, kHead).y, 0.8) << f;
    EXPECT_GT(bone(joints, kRightHip, kLeftHip).x, 0.97) << f;
    if (f < hanging_from) continue;
    EXPECT_LT(bone(joints, kLeftShoulder, kLeftElbow).y, -0.9) << f;
    EXPECT_LT(bone(joints, kRightElbow, kRightWrist).y, -0.9) << f;
    EXPECT_NEAR(std::min(joints[kLeftFoot].y, joints[kRightFoot].y), 0.03, 0.06) << f;
  }
  const size_t last = 3 * size_t{clip.frame_count - 1};
  EXPECT_NEAR(clip.root_translation_m[last + 2] - clip.root_translation_m[2], path_m, 0.02);
  EXPECT_NEAR(clip.root_translation_m[last], clip.root_translation_m[0], 0.02);
}

double bvh_path() { return 8.0 / 14 * leg_length_m(shipped_body()); }

TEST(ClipCases, TheReferenceWalksUpright) {
  const Read reference = read_case("bvh-reference");
  EXPECT_EQ(reference.clip.frame_count, 11u);
  expect_a_walk(reference.clip, bvh_path());
  EXPECT_TRUE(reference.says("12 frames at 30 a second")) << reference.report.summary;
  EXPECT_TRUE(reference.says("up y, T-pose from the first frame"));
  EXPECT_TRUE(reference.says("of the body's"));
}

TEST(ClipCases, BvhsThatSayTheSameAreTheSame) {
  const MotionClip reference = read_case("bvh-reference").clip;
  for (const char* name : {"bvh-colon-no-blank", "bvh-tabs-crlf", "bvh-name-with-spaces",
                           "bvh-six-channels", "bvh-sci", "bvh-exact-rate"}) {
    EXPECT_LT(difference(read_case(name).clip, reference), 1e-4) << name;
  }
}

TEST(ClipCases, LafansNamesAreKnown) {
  const Read lafan = read_case("bvh-lafan");
  EXPECT_EQ(lafan.clip.frame_count, 11u);
  expect_a_walk(lafan.clip, bvh_path());
}

TEST(ClipCases, AFrameTimeOfZeroNeedsAnOption) {
  EXPECT_NE(error_of("bvh-frame-time-0").find("Frame Time: not within 0.001 and 1 s; --source-fps"),
            std::string::npos);
  const MotionClip given = read_case("bvh-frame-time-0", {.source_fps = 30}).clip;
  EXPECT_LT(difference(given, read_case("bvh-reference").clip), 1e-4);
}

TEST(ClipCases, ALostBlankNamesItsLine) {
  const std::string error = error_of("bvh-missing-blank");
  EXPECT_NE(error.find(": line "), std::string::npos) << error;
}

TEST(ClipCases, AFirstFrameThatIsNoTPoseLeansNobody) {
  const Read read = read_case("bvh-no-tpose");
  EXPECT_TRUE(
      read.says("T-pose from the zero pose (the first frame is none: its trunk leans by 18"))
      << read.report.summary;
  for (uint32_t f = 2; f < read.clip.frame_count; ++f)
    EXPECT_GT(bone(joints_of(shipped_body(), read.clip, f), kPelvis, kNeck).y, 0.97) << f;
}

TEST(ClipCases, AKilledRecordersFramesAreReadAndCounted) {
  const Read read = read_case("bvh-short");
  EXPECT_TRUE(read.says("the header says 17 frames, the file holds 12")) << read.report.summary;
  EXPECT_LT(difference(read.clip, read_case("bvh-reference").clip), 1e-4);
}

TEST(ClipCases, ZUpStandsWithTheOptionAndWithout) {
  const MotionClip reference = read_case("bvh-reference").clip;
  const Read seen = read_case("bvh-zup"), told = read_case("bvh-zup", {.up = ClipUp::kZ});
  EXPECT_TRUE(seen.says("up z (as the person stands)")) << seen.report.summary;
  EXPECT_EQ(told.clip.rotations, seen.clip.rotations);
  // Its arms turn about the vertical; everything else is the reference.
  for (uint32_t f = 0; f < reference.frame_count; ++f) {
    const auto one = joints_of(shipped_body(), seen.clip, f),
               other = joints_of(shipped_body(), reference, f);
    for (const int j : {kPelvis, kSpine3, kHead, kLeftKnee, kRightAnkle, kLeftFoot}) {
      EXPECT_LT(length(one[static_cast<size_t>(j)] - other[static_cast<size_t>(j)]), 1e-4);
    }
  }
  // Told otherwise, the person would walk lying.
  EXPECT_NE(error_of("bvh-zup", {.up = ClipUp::kY}).find("lies while it walks"), std::string::npos);
}

TEST(ClipCases, GlbsThatSayTheSameAreTheSame) {
  const Read reference = read_case("glb-reference");
  EXPECT_EQ(reference.clip.frame_count, 12u);
  EXPECT_TRUE(reference.says("T-pose from the zero pose"));
  expect_a_walk(reference.clip, 0.55 * leg_length_m(shipped_body()) / 0.84, 1);
  EXPECT_EQ(read_case("glb-reference", {.neutral = Neutral::kZeroPose}).clip.rotations,
            reference.clip.rotations);
  for (const char* name : {"glb-mirrored-prop", "glb-sanitised-names", "glb-two-armatures", "vrma"})
    EXPECT_LT(difference(read_case(name).clip, reference.clip), 1e-5) << name;
  EXPECT_TRUE(read_case("vrma").says("names of VRM's humanBones"));
}

TEST(ClipCases, BadKeysAreRefusedByName) {
  EXPECT_NE(error_of("glb-equal-times").find("input: key "), std::string::npos)
      << error_of("glb-equal-times");
  EXPECT_NE(error_of("glb-sparse").find(".sparse: unsupported"), std::string::npos)
      << error_of("glb-sparse");
}

TEST(ClipCases, SmplsParametersInAllTheirShapes) {
  const Read reference = read_case("npz-smplx");
  EXPECT_EQ(reference.clip.frame_count, 12u);
  expect_a_walk(reference.clip, 0.55 * leg_length_m(shipped_body()) / 0.79, 1);
  for (const char* name : {"npz-smplh", "npz-rate-1d", "npz-yup"})
    EXPECT_LT(difference(read_case(name).clip, reference.clip), 1e-5) << name;
  EXPECT_TRUE(read_case("npz-yup").says("up y (as the person stands)"));
  // Without its hands, which are at rest there: fingers curl instead.
  const MotionClip smpl = read_case("npz-smpl72").clip;
  for (uint32_t f = 0; f < smpl.frame_count; ++f) {
    const auto one = joints_of(shipped_body(), smpl, f),
               other = joints_of(shipped_body(), reference.clip, f);
    for (uint32_t j = 0; j <= kRightWrist; ++j) EXPECT_LT(length(one[j] - other[j]), 1e-5);
  }
  EXPECT_NE(error_of("npz-no-rate").find("--source-fps gives the rate"), std::string::npos);
  EXPECT_LT(difference(read_case("npz-no-rate", {.source_fps = 30}).clip, reference.clip), 1e-5);
}

// What was read rightly before the readers came here is what it was, to the bit: content hashes of
// packages that figurine-train motion of commit 23fe52d wrote, under the name "digest".
struct Digest {
  const char *name, *hash;
  RetargetOptions options;
};

TEST(ClipBits, AreThoseOfTheToolchainsReaders) {
  const Digest digests[] = {
      {"bvh-exact-rate", "67f3e80988ea27d1850ff834029026fb", {}},
      {"glb-reference", "3645bf1ffff3e6da0e280f03edb8004c", {.neutral = Neutral::kZeroPose}},
      {"glb-reference",
       "33c0bed10de4bc0ed3c095b0b52a9949",
       {.frames_per_second = 24, .neutral = Neutral::kZeroPose, .smooth_s = 0.03f}},
      {"npz-smplx", "784de44a6f184aa46f4f3ea2a5ef03e7", {}},
      {"npz-rate-1d", "784de44a6f184aa46f4f3ea2a5ef03e7", {}},
      {"npz-smplh", "d134ce2ba828684cb43dd7eec0f7899a", {}},
      {"npz-yup", "8f1b36794b448e51e08ed219005cbf6e", {.up = ClipUp::kY}}};
  for (const Digest& digest : digests) {
    RetargetOptions options = digest.options;
    options.name = "digest";
    const Read read = read_case(digest.name, options);
    EXPECT_EQ(tests::content_hash(read.clip), digest.hash) << digest.name;
  }
}

}  // namespace
}  // namespace figurine::ports::clip_cases_test
