// Which nodes of a file's hierarchy are the joints of a person: by the names that tools give them.
//
// One table for all formats: Autodesk's HumanIK (Mixamo, LaFAN, CMU's conversions, Rokoko), VRM and
// VRoid, 3ds Max' Biped (Rocketbox), Unreal and Blender, Poser and DAZ, names of joints (SMPL,
// Xsens), and MMD's in English. Case, blanks and separators do not count, nor do prefixes that the
// names of a skeleton share ("mixamorig:", "Bip01 ", "J_Bip_", "Avatar_"), numbers that Blender
// adds
// (".001"), or the way that a side is written ("Left", "L_", ".L"). The spine is whatever lies
// between hips and neck. VRM files say their bones themselves. A map says what the table does not.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "figurine/status.h"
#include "ports/motion/skeleton.h"

namespace figurine::ports {

// Joint of the 55 (by its name) to the name of a node.
using JointMap = std::map<std::string, std::string>;

// A file of JSON: {"left_knee": "Shin_L", ...}. kInvalidArgument, naming `where`, for anything else
// and for joints that there are not, with the nearest ones.
Result<JointMap> parse_joint_map(std::string_view text, const std::string& where);

struct NamedNodes {
  std::string where;  // the file, for messages
  std::span<const std::string> names;
  std::span<const int> parents;  // in any order; -1: none
  std::vector<bool> moved;       // whether the motion moves them
  std::span<const std::pair<std::string, uint32_t>> human_bones = {};  // VRM's
};

struct JointNodes {
  std::array<int, kJointCount> node;  // -1: none
  int second_neck = -1;               // between neck and head
  std::string naming;                 // which names: "HumanIK", "VRM", ...
  std::string note;                   // what was chosen of several, in words; empty: nothing

  JointNodes() { node.fill(-1); }
  bool has(int joint) const { return node[static_cast<size_t>(joint)] >= 0; }
  size_t at(int joint) const { return static_cast<size_t>(node[static_cast<size_t>(joint)]); }
};

// Hips, legs down to the ankles and arms down to the wrists must be there; fingers count from two
// joints on. Of several skeletons the one that moves is taken. kUnsupported naming the joint, the
// nearest names and --map; kInvalidArgument for a map that names what there is not.
Result<JointNodes> find_joints(const NamedNodes& nodes, const JointMap& map);

}  // namespace figurine::ports
