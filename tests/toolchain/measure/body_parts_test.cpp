// Parts of a body by its joints' names: on the mannequin they are where a person has them.
#include "toolchain/measure/body_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "runtime/test_packages.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/body/texel_body.h"

namespace figurine::measure::body_parts_test {
namespace {

TEST(BodyParts, OfTheMannequinLieWhereAPersonHasThem) {
  const body::TexelBody texels = body::make_texel_body(body::make_mannequin(), 64);
  const Body body = texels.view();
  const auto joint_m = [&](size_t joint, size_t k) { return body.joint_position_m[3 * joint + k]; };
  const std::vector<BodyPart> parts = texel_parts(body);
  std::map<BodyPart, size_t> count;
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const float* place = &body.texel_position_m[size_t{3} * i];
    ++count[parts[i]];
    switch (parts[i]) {
      case BodyPart::kHead:
        EXPECT_GT(place[1], joint_m(body::kSpine3, 1)) << i;
        break;
      case BodyPart::kLowerBody:
        EXPECT_LT(place[1], joint_m(body::kSpine2, 1)) << i;
        break;
      case BodyPart::kHands:
        EXPECT_GT(std::abs(place[0]), joint_m(body::kLeftElbow, 0)) << i;
        break;
      case BodyPart::kUpperBody:
        EXPECT_GT(place[1], joint_m(body::kLeftHip, 1) - 0.3f) << i;
        EXPECT_LT(place[1], joint_m(body::kHead, 1)) << i;
        break;
      default:
        ADD_FAILURE() << "texel " << i << " is of no part";
    }
  }
  for (const BodyPart part :
       {BodyPart::kHead, BodyPart::kUpperBody, BodyPart::kLowerBody, BodyPart::kHands}) {
    std::printf("part %d: %zu of %u texels\n", int(part), count[part], body.texel_count());
    EXPECT_GT(count[part], body.texel_count() / 50);
  }
  const std::vector<uint32_t> bust = bust_texels(body);
  EXPECT_GT(bust.size(), count[BodyPart::kHead]) << "shoulders too";
  EXPECT_LT(bust.size(), body.texel_count() / 2);
  for (const uint32_t texel : bust)
    EXPECT_GT(body.texel_position_m[size_t{3} * texel + 1], joint_m(body::kSpine2, 1));
}

TEST(BodyParts, AJointOfAnotherNameGoesWithItsParent) {
  const tests::SyntheticBody body = tests::make_test_body(
      {.joint_names = {"pelvis", "left_tail", "right_wrist", "right_index1"}});
  EXPECT_EQ(joint_parts(body.body()),
            (std::vector<BodyPart>{BodyPart::kLowerBody, BodyPart::kLowerBody, BodyPart::kHands,
                                   BodyPart::kHands}));
}

TEST(BodyParts, WithoutKnownNamesThereIsNoPartAndNoBust) {
  const tests::SyntheticBody body = tests::make_test_body();
  const std::vector<BodyPart> parts = texel_parts(body.body());
  EXPECT_EQ(size_t(std::ranges::count(parts, BodyPart::kOther)), parts.size());
  EXPECT_TRUE(bust_texels(body.body()).empty());
}

}  // namespace
}  // namespace figurine::measure::body_parts_test
