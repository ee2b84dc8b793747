// A person as a BVH text: hierarchy in a T-pose, any names, any axes, poses as rotations of joints.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "ports/motion/rotation.h"

namespace figurine::ports::tests {

struct MadeJoint {
  std::string name;  // HumanIK's
  int parent;
  Vec3 offset;  // centimetres, facing +z, y up
};

// 22 joints, legs of 84 cm.
inline std::vector<MadeJoint> made_skeleton() {
  std::vector<MadeJoint> out = {{"Hips", -1, {0, 0, 0}},   {"Spine", 0, {0, 10, 0}},
                                {"Spine1", 1, {0, 12, 0}}, {"Spine2", 2, {0, 12, 0}},
                                {"Neck", 3, {0, 16, 0}},   {"Head", 4, {0, 10, 2}}};
  for (const double side : {1.0, -1.0}) {
    const std::string s = side > 0 ? "Left" : "Right";
    const int first = static_cast<int>(out.size());
    out.push_back({s + "UpLeg", 0, {9 * side, -5, 0}});
    out.push_back({s + "Leg", first, {0, -42, 0}});
    out.push_back({s + "Foot", first + 1, {0, -42, 0}});
    out.push_back({s + "ToeBase", first + 2, {0, -6, 13}});
    out.push_back({s + "Shoulder", 3, {4 * side, 12, 0}});
    out.push_back({s + "Arm", first + 4, {13 * side, 0, 0}});
    out.push_back({s + "ForeArm", first + 5, {28 * side, 0, 0}});
    out.push_back({s + "Hand", first + 6, {25 * side, 0, 0}});
  }
  return out;
}

struct MadePerson {
  std::vector<MadeJoint> joints = made_skeleton();
  std::function<std::string(const std::string&)> name = [](const std::string& own) { return own; };
  Quat axes = no_turn();  // the file's world from y up, facing +z: of offsets and poses
  double scale = 1;
  std::string frame_time = "0.0333333";
  int frames = 20;
  bool t_pose_first = true;
  // Rotations of frame f in the person's own axes (about x, y or z alone is not needed), by HumanIK
  // name; missing: none.
  std::function<std::map<std::string, Quat>(int)> pose = walk;
  double step_cm = 4;  // forward, a frame
  Vec3 forward{0, 0, 1};

  // Arms that hang, legs that swing.
  static std::map<std::string, Quat> walk(int f) {
    const double swing = 0.4 * std::sin(0.5 * f);
    return {{"LeftArm", about({0, 0, 1}, -1.4)},
            {"RightArm", about({0, 0, 1}, 1.4)},
            {"LeftUpLeg", about({1, 0, 0}, swing)},
            {"RightUpLeg", about({1, 0, 0}, -swing)}};
  }

  std::string text() const {
    std::string out = "HIERARCHY\n";
    std::vector<int> order;
    write_joint(0, out, order);
    out += "MOTION\nFrames: " + std::to_string(frames) + "\nFrame Time: " + frame_time + "\n";
    for (int f = 0; f < frames; ++f) {
      const bool neutral = f == 0 && t_pose_first;
      const std::map<std::string, Quat> turns = neutral ? std::map<std::string, Quat>{} : pose(f);
      const Vec3 place = scale * rotated(axes, Vec3(0, 95, 0) + double(f) * step_cm * forward);
      for (int k = 0; k < 3; ++k) out += number(place[k]);
      for (const int j : order) {
        const auto found = turns.find(joints[static_cast<size_t>(j)].name);
        const Quat own = found == turns.end() ? no_turn() : found->second;
        const Vec3 angles = zyx_degrees(product(product(axes, own), reversed(axes)));
        for (int k = 0; k < 3; ++k) out += number(angles[k]);
      }
      out += "\n";
    }
    return out;
  }

 private:
  static std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6f ", value);
    return text;
  }
  // Zrotation Yrotation Xrotation: Rz Ry Rx.
  static Vec3 zyx_degrees(const Quat& q) {
    const Mat3 m = matrix_of(q);  // columns
    const double to_degrees = 57.29577951308232;
    return {to_degrees * std::atan2(m[0][1], m[0][0]),
            to_degrees * std::asin(std::clamp(-m[0][2], -1.0, 1.0)),
            to_degrees * std::atan2(m[1][2], m[2][2])};
  }
  void write_joint(int j, std::string& out, std::vector<int>& order) const {
    const MadeJoint& joint = joints[static_cast<size_t>(j)];
    order.push_back(j);
    out += (joint.parent < 0 ? "ROOT " : "JOINT ") + name(joint.name) + "\n{\nOFFSET ";
    const Vec3 offset = scale * rotated(axes, joint.offset);
    for (int k = 0; k < 3; ++k) out += number(offset[k]);
    out += joint.parent < 0 ? "\nCHANNELS 6 Xposition Yposition Zposition " : "\nCHANNELS 3 ";
    out += "Zrotation Yrotation Xrotation\n";
    bool leaf = true;
    for (int child = j + 1; child < static_cast<int>(joints.size()); ++child) {
      if (joints[static_cast<size_t>(child)].parent != j) continue;
      write_joint(child, out, order);
      leaf = false;
    }
    if (leaf) out += "End Site\n{\nOFFSET 0 1 0\n}\n";
    out += "}\n";
  }
};

}  // namespace figurine::ports::tests
