#include "toolchain/measure/body_parts.h"

#include <algorithm>
#include <array>

namespace figurine::measure {

namespace {

struct NamedJoint {
  std::string_view name;  // without its side
  BodyPart part;
};

constexpr std::array<NamedJoint, 18> kNamedJoints{{
    {"neck", BodyPart::kHead},
    {"head", BodyPart::kHead},
    {"jaw", BodyPart::kHead},
    {"eye", BodyPart::kHead},
    {"eye_smplhf", BodyPart::kHead},
    {"spine1", BodyPart::kUpperBody},
    {"spine2", BodyPart::kUpperBody},
    {"spine3", BodyPart::kUpperBody},
    {"collar", BodyPart::kUpperBody},
    {"shoulder", BodyPart::kUpperBody},
    {"elbow", BodyPart::kUpperBody},
    {"pelvis", BodyPart::kLowerBody},
    {"hip", BodyPart::kLowerBody},
    {"knee", BodyPart::kLowerBody},
    {"ankle", BodyPart::kLowerBody},
    {"foot", BodyPart::kLowerBody},
    {"wrist", BodyPart::kHands},
    {"hand", BodyPart::kHands},
}};

constexpr float kWorn = 0.1f;  // of a texel's skin weights

std::string_view without_side(std::string_view name) {
  for (const std::string_view side : {"left_", "right_"}) {
    if (name.starts_with(side)) return name.substr(side.size());
  }
  return name;
}

}  // namespace

const char* to_string(BodyPart part) {
  constexpr std::array kNames{"head", "upper_body", "lower_body", "hands", "other"};
  return kNames[static_cast<size_t>(part)];
}

uint8_t strongest_joint(const Body& body, uint32_t texel) {
  const float* weights = &body.texel_weights[size_t{texel} * kSkinInfluences];
  const auto strongest =
      static_cast<size_t>(std::max_element(weights, weights + kSkinInfluences) - weights);
  return body.texel_joints[size_t{texel} * kSkinInfluences + strongest];
}

std::vector<BodyPart> joint_parts(const Body& body) {
  std::vector<BodyPart> parts(body.joint_count(), BodyPart::kOther);
  for (size_t j = 0; j < parts.size(); ++j) {
    const std::string_view name = without_side(body.joint_names[j]);
    const auto* known = std::ranges::find(kNamedJoints, name, &NamedJoint::name);
    if (known != kNamedJoints.end()) {
      parts[j] = known->part;
    } else if (body.parents[j] >= 0) {
      parts[j] = parts[static_cast<size_t>(body.parents[j])];
    }
  }
  return parts;
}

namespace {

// Of head or hands, but moved by the upper body too: where collars and cuffs are.
bool is_worn(const Body& body, const std::vector<BodyPart>& of_joint, uint32_t texel,
             BodyPart part) {
  if (part != BodyPart::kHead && part != BodyPart::kHands) return false;
  float upper = 0;
  for (size_t k = size_t{texel} * kSkinInfluences; k < size_t{texel + 1} * kSkinInfluences; ++k) {
    if (of_joint[body.texel_joints[k]] == BodyPart::kUpperBody) upper += body.texel_weights[k];
  }
  return upper >= kWorn;
}

}  // namespace

std::vector<BodyPart> texel_parts(const Body& body) {
  const std::vector<BodyPart> of_joint = joint_parts(body);
  std::vector<BodyPart> parts(body.texel_count());
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const size_t joint = strongest_joint(body, i);
    const bool waist =
        body.joint_names[joint] == "pelvis" &&
        body.texel_position_m[size_t{3} * i + 1] > body.joint_position_m[3 * joint + 1];
    parts[i] = waist || is_worn(body, of_joint, i, of_joint[joint]) ? BodyPart::kUpperBody
                                                                    : of_joint[joint];
  }
  return parts;
}

std::vector<uint32_t> bust_texels(const Body& body) {
  std::vector<uint32_t> texels;
  if (std::ranges::find(body.joint_names, "head") == body.joint_names.end()) return texels;
  const std::vector<BodyPart> of_joint = joint_parts(body);
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const size_t joint = strongest_joint(body, i);
    if (of_joint[joint] == BodyPart::kHead || without_side(body.joint_names[joint]) == "collar")
      texels.push_back(i);
  }
  return texels;
}

}  // namespace figurine::measure
