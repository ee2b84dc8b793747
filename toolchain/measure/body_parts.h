// Which texels are what of a person: head, upper body, lower body, hands, by the joint that moves a
// texel most. Joints are known by the names of SMPL-X, so it works for any body that has them,
// whatever its mesh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/body.h"

namespace figurine::measure {

// The joint with a texel's largest skin weight, of equals the first.
uint8_t strongest_joint(const Body& body, uint32_t texel);

// Hands are a part of their own: who puts on a jacket keeps the hands. kOther: of no joint with a
// known name and no such parent.
enum class BodyPart : uint8_t { kHead, kUpperBody, kLowerBody, kHands, kOther };
inline constexpr std::array kBodyParts{BodyPart::kHead, BodyPart::kUpperBody, BodyPart::kLowerBody,
                                       BodyPart::kHands, BodyPart::kOther};
const char* to_string(BodyPart part);  // "head", "upper_body", "lower_body", "hands", "other"

// [J] by name: neck, head, jaw and eyes; spine, collars, shoulders and elbows; pelvis, hips, knees,
// ankles and feet; wrists. A joint of another name goes with its parent (fingers, toes, hair).
std::vector<BodyPart> joint_parts(const Body& body);
// [N] of a texel's strongest joint. But of the upper body is the waist above the joint of the
// pelvis, where shirts hang over trousers, and what of neck and wrists the upper body moves by a
// tenth or more, where collars and cuffs are.
std::vector<BodyPart> texel_parts(const Body& body);

// Texels that head, neck and collar bones move most: head and shoulders, as captures frame them.
// None where the body has no joint called "head".
std::vector<uint32_t> bust_texels(const Body& body);

}  // namespace figurine::measure
