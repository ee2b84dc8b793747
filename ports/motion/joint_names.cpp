#include "ports/motion/joint_names.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "ports/motion/gltf_json.h"

namespace figurine::ports {
namespace {

// Words of a naming, without sides; alternatives are tried in their order.
struct Naming {
  const char* name;
  const char *pelvis, *hip, *knee, *ankle, *foot, *collar, *shoulder, *elbow, *wrist;
};
constexpr Naming kNamings[] = {
    {"HumanIK", "hips", "upleg|thigh", "leg|shin", "foot", "toebase|toe|toes|ball", "shoulder",
     "arm|uparm", "forearm|lowarm", "hand"},
    {"VRM", "hips", "upperleg", "lowerleg", "foot", "toes|toebase|toe", "shoulder", "upperarm",
     "lowerarm", "hand"},
    {"Biped", "pelvis|hips|hip", "thigh|upperleg|upleg", "calf|shin|lowerleg|leg", "foot",
     "toe0|ball|toebase|toe|toes", "clavicle|collar|collarbone|shoulder", "upperarm",
     "forearm|lowerarm", "hand"},
    {"Poser", "hip|pelvis|hips", "thigh|thighbend", "shin|calf", "foot", "toe|toes", "collar",
     "shldr|shldrbend|shoulder", "forearm|forearmbend", "hand"},
    {"joints", "pelvis|hips|hip|root", "hip", "knee", "ankle", "foot|toe|toes|toebase|ball",
     "collar|clavicle", "shoulder", "elbow", "wrist"},
    {"MMD", "hips|pelvis", "leg", "knee", "ankle", "toe|toes", "shoulder", "arm", "elbow", "wrist"},
};
constexpr const char* kNeckWords = "neck|neck01|neck1|necklower|necktwist01";
constexpr const char* kHeadWords = "head";
constexpr const char* kJawWords = "jaw|mjaw|jawroot";
constexpr const char* kEyeWords = "eye";

// Fingers in the order of the 55 joints, and their words. Biped counts them from the thumb on.
struct Finger {
  const char *word, *vrm, *biped;
};
constexpr Finger kFingers[] = {{"index", "index", "1"},
                               {"middle", "middle", "2"},
                               {"pinky", "little", "4"},
                               {"ring", "ring", "3"},
                               {"thumb", "thumb", "0"}};

struct Wanted {
  int joint;
  int side;  // 0: none, 1: left, 2: right
  std::vector<std::string> words;
  bool needed;
  std::vector<std::vector<std::string>> texts = {};  // of each word, with its side
};

std::vector<std::string> split(const std::string& words) {
  std::vector<std::string> out(1);
  for (const char c : words) {
    if (c == '|') {
      out.emplace_back();
    } else {
      out.back() += c;
    }
  }
  return out;
}

std::vector<std::string> finger_words(const Finger& finger, int i) {
  const std::string number = std::to_string(i + 1), word = finger.word, vrm = finger.vrm;
  std::vector<std::string> words = {"hand" + word + number,   word + number, word + "0" + number,
                                    word + "finger" + number, vrm + number,  "hand" + vrm + number};
  const bool thumb = word == "thumb";
  constexpr const char* kBones[] = {"proximal", "intermediate", "distal"};
  // VRM 1 calls the thumb's joints metacarpal, proximal, distal; VRM 0 like the others'.
  if (thumb && i == 0) words.push_back("thumbmetacarpal");
  words.push_back(vrm + kBones[i]);
  if (thumb && i == 1) words.push_back("thumbproximal");
  words.push_back("finger" + std::string(finger.biped) + (i == 0 ? "" : std::to_string(i)));
  return words;
}

// How a word may be written with its side.
std::vector<std::string> spellings(const std::string& word, int side) {
  if (side == 0) return {word, "c" + word};
  const std::string whole = side == 1 ? "left" : "right", letter = whole.substr(0, 1);
  return {whole + word, letter + word, word + whole, word + letter};
}

std::vector<Wanted> make_wanted(const Naming& naming) {
  std::vector<Wanted> out = {{kPelvis, 0, split(naming.pelvis), true},
                             {kNeck, 0, split(kNeckWords), false},
                             {kHead, 0, split(kHeadWords), false},
                             {kJaw, 0, split(kJawWords), false}};
  for (int side = 0; side < 2; ++side) {
    const auto add = [&](int joint, const char* words, bool needed) {
      out.push_back({joint + side, side + 1, split(words), needed});
    };
    add(kLeftHip, naming.hip, true);
    add(kLeftKnee, naming.knee, true);
    add(kLeftAnkle, naming.ankle, true);
    add(kLeftFoot, naming.foot, false);
    add(kLeftCollar, naming.collar, false);
    add(kLeftShoulder, naming.shoulder, true);
    add(kLeftElbow, naming.elbow, true);
    add(kLeftWrist, naming.wrist, true);
    add(kLeftEye, kEyeWords, false);
    const int fingers = side == 0 ? kLeftIndex1 : kRightIndex1;
    for (int f = 0; f < 5; ++f) {
      for (int i = 0; i < 3; ++i)
        out.push_back({fingers + 3 * f + i, side + 1, finger_words(kFingers[f], i), false});
    }
  }
  for (Wanted& joint : out) {
    for (const std::string& word : joint.words) joint.texts.push_back(spellings(word, joint.side));
  }
  return out;
}

constexpr size_t kVrm = 1;  // of the namings
const std::vector<Wanted>& wanted_joints(size_t naming) {
  static const std::vector<std::vector<Wanted>> all = [] {
    std::vector<std::vector<Wanted>> out;
    for (const Naming& one : kNamings) out.push_back(make_wanted(one));
    return out;
  }();
  return all[naming];
}

// Small letters and digits alone, behind the last colon or bar.
std::string plain(std::string_view name) {
  const size_t colon = name.find_last_of(":|");
  if (colon != std::string_view::npos && colon + 1 < name.size()) name = name.substr(colon + 1);
  std::string out;
  for (const char c : name) {
    if (c >= 'A' && c <= 'Z') {
      out += static_cast<char>(c + 32);
    } else if (c != ' ' && c != '_' && c != '-' && c != '.' && c != '\t') {
      out += c;
    }
  }
  return out;
}

// Without a number that a tool has added: Blender's ".001", or "_12".
std::string_view without_number(std::string_view name, char separator) {
  const size_t at = name.find_last_not_of("0123456789");
  const bool number = at != std::string_view::npos && at > 0 && at + 1 < name.size() &&
                      name[at] == separator && (separator == '_' || name.size() - at == 4);
  return number ? name.substr(0, at) : name;
}

// The forms under which a node is looked for, the nearest to its own first.
struct Forms {
  std::string own, unnumbered, bare;
};
Forms forms_of(const std::string& name) {
  const std::string_view blender = without_number(name, '.');
  return {plain(name), plain(blender), plain(without_number(blender, '_'))};
}

size_t distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0]++;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t changed = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, diagonal + 1});
    }
  }
  return row[b.size()];
}

std::string shown_name(const std::string& name) {
  std::string out = "'";
  for (const char c : name.substr(0, 64)) out += c < ' ' || c > '~' ? '?' : c;
  return out + "'";
}

// The three names nearest to any of the words.
std::string nearest(std::span<const std::string> names, const std::vector<std::string>& words) {
  std::vector<std::pair<size_t, std::string>> scored;
  for (const std::string& name : names) {
    const std::string text = plain(name).substr(0, 64);
    size_t best = SIZE_MAX;
    for (const std::string& word : words) best = std::min(best, distance(text, word));
    if (!name.empty()) scored.emplace_back(best, name);
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string out;
  for (size_t i = 0; i < std::min<size_t>(scored.size(), 3); ++i)
    out += (i == 0 ? "" : ", ") + shown_name(scored[i].second);
  return out;
}

class Finder {
 public:
  explicit Finder(const NamedNodes& nodes) : nodes_(nodes) {
    for (size_t n = 0; n < nodes.names.size(); ++n) {
      const Forms forms = forms_of(nodes.names[n]);
      const std::string* const each[] = {&forms.own, &forms.unnumbered, &forms.bare};
      for (int how = 0; how < 3; ++how) {
        if (how == 0 || *each[how] != *each[how - 1])
          by_text_[*each[how]].emplace_back(how, static_cast<int>(n));
      }
    }
  }

  size_t size() const { return nodes_.names.size(); }
  int parent(int node) const { return nodes_.parents[static_cast<size_t>(node)]; }
  bool below(int node, int ancestor) const {
    for (; node >= 0; node = parent(node)) {
      if (node == ancestor) return true;
    }
    return false;
  }

  // What all names of a skeleton begin with, by vote of the needed joints.
  std::string prefix_of(const std::vector<Wanted>& wanted) const {
    std::map<std::string, std::vector<int>> votes;
    for (const Wanted& joint : wanted) {
      if (!joint.needed) continue;
      for (const std::vector<std::string>& texts : joint.texts) {
        for (const std::string& text : texts) {
          for (const auto& [form, nodes] : by_text_) {
            if (!form.ends_with(text)) continue;
            std::vector<int>& joints = votes[form.substr(0, form.size() - text.size())];
            if (joints.empty() || joints.back() != joint.joint) joints.push_back(joint.joint);
          }
        }
      }
    }
    std::string best;
    size_t most = 0;
    for (const auto& [prefix, joints] : votes) {
      if (joints.size() > most || (joints.size() == most && prefix.size() < best.size())) {
        best = prefix;
        most = joints.size();
      }
    }
    return best;
  }

  // The nodes that may be a joint: all of the first word that any has, best fits first.
  std::vector<int> candidates(const Wanted& joint, const std::string& prefix) const {
    for (const std::vector<std::string>& texts : joint.texts) {
      std::vector<std::pair<int, int>> found;  // how it fits, and the node
      for (const std::string& text : texts) {
        const auto at = by_text_.find(prefix + text);
        if (at != by_text_.end()) found.insert(found.end(), at->second.begin(), at->second.end());
      }
      if (found.empty()) continue;
      std::stable_sort(found.begin(), found.end());
      std::vector<int> out;
      for (const auto& [how, node] : found) {
        if (std::find(out.begin(), out.end(), node) == out.end()) out.push_back(node);
      }
      return out;
    }
    return {};
  }

 private:
  const NamedNodes& nodes_;
  // Form to how it was made (0: the name itself, 1: without Blender's number, 2: without any) and
  // the node.
  std::map<std::string, std::vector<std::pair<int, int>>> by_text_;
};

constexpr uint32_t kBodyJoints = kJaw;

struct Found {
  JointNodes joints;
  size_t count = 0, moved = 0;  // body joints; nodes of the motion
  std::optional<Wanted> missing;
};

// The joints of one skeleton: that of the given hips, or all that there is (-1).
Found collect(const Finder& finder, const NamedNodes& nodes, const std::vector<Wanted>& wanted,
              const std::string& prefix, int hips) {
  // As far up as no other skeleton's hips are.
  int top = hips;
  const std::vector<int> others = finder.candidates(wanted[0], prefix);
  while (top >= 0 && finder.parent(top) >= 0 &&
         std::none_of(others.begin(), others.end(), [&](int other) {
           return other != hips && finder.below(other, finder.parent(top));
         })) {
    top = finder.parent(top);
  }
  Found found;
  for (const Wanted& joint : wanted) {
    int chosen = -1;
    std::vector<int> candidates = finder.candidates(joint, prefix);
    if (joint.joint == kPelvis && hips >= 0) candidates = {hips};
    // Inside the skeleton before beside it, and moved before still.
    int best = -1;
    for (const int node : candidates) {
      if (others.size() > 1 && top >= 0 && !finder.below(node, top)) continue;
      const int score = 2 * (hips >= 0 && finder.below(node, hips)) +
                        (nodes.moved[static_cast<size_t>(node)] ? 1 : 0);
      if (score > best) {
        best = score;
        chosen = node;
      }
    }
    if (chosen < 0) {
      if (joint.needed && !found.missing) found.missing = joint;
      continue;
    }
    found.joints.node[static_cast<size_t>(joint.joint)] = chosen;
    found.count += static_cast<uint32_t>(joint.joint) < kBodyJoints;
    found.moved += nodes.moved[static_cast<size_t>(chosen)];
  }
  return found;
}

// One finger joint alone is a marker, no finger (CMU's LeftHandIndex1); the middle one still tells
// where the hand points.
void drop_lone_fingers(JointNodes& joints) {
  for (int first = kLeftIndex1; first < static_cast<int>(kJointCount); first += 3) {
    if (joints.has(first) && joints.has(first + 1)) continue;
    for (int i = 0; i < 3; ++i) {
      if (i > 0 || (first != kLeftMiddle1 && first != kRightMiddle1))
        joints.node[static_cast<size_t>(first + i)] = -1;
    }
  }
}

// Nodes from one down to another, without either; empty if it does not lie below.
std::vector<int> between_nodes(const Finder& finder, int from, int to) {
  std::vector<int> out;
  if (from < 0 || to < 0 || from == to || !finder.below(to, from)) return out;
  for (int n = finder.parent(to); n != from; n = finder.parent(n)) out.insert(out.begin(), n);
  return out;
}

void find_spine(const Finder& finder, JointNodes& joints) {
  const int hips = joints.node[kPelvis];
  int top = joints.node[kNeck] >= 0 ? joints.node[kNeck] : joints.node[kHead];
  int base = hips;  // or what carries hips and spine side by side
  while (base >= 0 && top >= 0 && !finder.below(top, base)) base = finder.parent(base);
  std::vector<int> spine = between_nodes(finder, base, top);
  if (top < 0) {  // what carries both arms
    const int left = joints.node[kLeftShoulder], right = joints.node[kRightShoulder];
    for (int n = left; n >= 0 && n != hips; n = finder.parent(n)) {
      if (!finder.below(right, n)) continue;
      spine = between_nodes(finder, hips, n);
      spine.push_back(n);
      break;
    }
  }
  const size_t count = spine.size();
  if (count > 0) joints.node[kSpine1] = spine[0];
  if (count > 1) joints.node[kSpine2] = spine[count > 3 ? count / 2 : 1];
  if (count > 2) joints.node[kSpine3] = spine[count - 1];
  const std::vector<int> neck = between_nodes(finder, joints.node[kNeck], joints.node[kHead]);
  if (neck.size() == 1) joints.second_neck = neck[0];
}

int joint_number(const std::string& name) {
  const auto at = std::find(joint_names().begin(), joint_names().end(), name);
  return at == joint_names().end() ? -1 : static_cast<int>(at - joint_names().begin());
}

// The bones that a VRM file names itself.
Result<JointNodes> from_human_bones(const NamedNodes& nodes) {
  JointNodes joints;
  joints.naming = "VRM's humanBones";
  const std::vector<Wanted>& wanted = wanted_joints(kVrm);
  for (const Wanted& joint : wanted) {
    for (const std::string& word : joint.words) {
      const std::string side = joint.side == 0 ? "" : joint.side == 1 ? "left" : "right";
      const auto bone =
          std::find_if(nodes.human_bones.begin(), nodes.human_bones.end(),
                       [&](const auto& entry) { return plain(entry.first) == side + word; });
      if (bone == nodes.human_bones.end()) continue;
      joints.node[static_cast<size_t>(joint.joint)] = static_cast<int>(bone->second);
      break;
    }
    if (joint.needed && !joints.has(joint.joint)) {
      return Status(StatusCode::kUnsupported, nodes.where + ": humanBones: none for " +
                                                  joint_names()[static_cast<size_t>(joint.joint)]);
    }
  }
  return joints;
}

Status apply_map(const NamedNodes& nodes, const JointMap& map, JointNodes& joints) {
  for (const auto& [joint, name] : map) {
    auto node = std::find(nodes.names.begin(), nodes.names.end(), name);
    if (node == nodes.names.end()) {
      node = std::find_if(nodes.names.begin(), nodes.names.end(),
                          [&](const std::string& other) { return plain(other) == plain(name); });
    }
    if (node == nodes.names.end()) {
      return Status(StatusCode::kInvalidArgument,
                    nodes.where + ": --map: " + joint + ": there is no " + shown_name(name) +
                        "; nearest: " + nearest(nodes.names, {plain(name)}));
    }
    joints.node[static_cast<size_t>(joint_number(joint))] =
        static_cast<int>(node - nodes.names.begin());
  }
  return {};
}

Status missing_joint(const NamedNodes& nodes, const Found& found) {
  if (found.count == 0) {
    std::string names;
    for (const std::string& name : nodes.names.first(std::min<size_t>(nodes.names.size(), 5)))
      names += (names.empty() ? "" : ", ") + shown_name(name);
    return Status(StatusCode::kUnsupported,
                  nodes.where +
                      ": no joint has a known name (Hips, LeftUpLeg, LeftArm, ...); it "
                      "has " +
                      names + ", ...; --map FILE says which joint is which");
  }
  const Wanted& joint = *found.missing;
  std::vector<std::string> words;
  for (const std::string& word : joint.words) words.push_back(spellings(word, joint.side)[0]);
  return Status(StatusCode::kUnsupported,
                nodes.where + ": no joint " + joint_names()[static_cast<size_t>(joint.joint)] +
                    " (" + words[0] + "); nearest: " + nearest(nodes.names, words) +
                    "; --map FILE says which joint is which");
}

}  // namespace

Result<JointMap> parse_joint_map(std::string_view text, const std::string& where) {
  const Result<nlohmann::json> json =
      parse_gltf_json(std::as_bytes(std::span(text.data(), text.size())), where);
  if (!json.ok()) return Status(StatusCode::kInvalidArgument, json.status().message());
  if (!json->is_object() || json->empty()) {
    return Status(StatusCode::kInvalidArgument,
                  where + ": not an object of joints and names, like {\"left_knee\": \"Shin_L\"}");
  }
  JointMap map;
  for (const auto& [joint, name] : json->items()) {
    if (joint_number(joint) < 0) {
      return Status(StatusCode::kInvalidArgument,
                    where + ": " + shown_name(joint) +
                        " is no joint; nearest: " + nearest(joint_names(), {plain(joint)}));
    }
    if (!name.is_string())
      return Status(StatusCode::kInvalidArgument, where + ": " + joint + ": not a name");
    map[joint] = name.get<std::string>();
  }
  return map;
}

Result<JointNodes> find_joints(const NamedNodes& nodes, const JointMap& map) {
  const Finder finder(nodes);
  if (!nodes.human_bones.empty() && map.empty()) {
    Result<JointNodes> joints = from_human_bones(nodes);
    if (!joints.ok()) return joints;
    drop_lone_fingers(*joints);
    find_spine(finder, *joints);
    return joints;
  }
  std::optional<Found> best;
  for (size_t naming = 0; naming < std::size(kNamings); ++naming) {
    const std::vector<Wanted>& wanted = wanted_joints(naming);
    const std::string prefix = finder.prefix_of(wanted);
    std::vector<int> hips = finder.candidates(wanted[0], prefix);
    if (hips.empty()) hips = {-1};
    std::optional<Found> of_naming;
    size_t alike = 0;
    for (const int root : hips) {
      Found found = collect(finder, nodes, wanted, prefix, root);
      found.joints.naming = kNamings[naming].name;
      const auto better = [](const Found& a, const Found& b) {
        if (a.missing.has_value() != b.missing.has_value()) return !a.missing.has_value();
        return a.moved != b.moved ? a.moved > b.moved : a.count > b.count;
      };
      if (of_naming && !better(found, *of_naming)) {
        alike += !found.missing && found.moved > 0;
        continue;
      }
      alike = of_naming && !of_naming->missing && of_naming->moved > 0 ? alike + 1 : alike;
      of_naming = found;
    }
    if (alike > 0) {
      of_naming->joints.note = std::to_string(alike + 1) + " skeletons move, taken is that of " +
                               shown_name(nodes.names[of_naming->joints.at(kPelvis)]);
    }
    const bool better = !best || (best->missing.has_value() == of_naming->missing.has_value()
                                      ? of_naming->count > best->count
                                      : !of_naming->missing.has_value());
    if (better) best = of_naming;
  }
  JointNodes joints = best->joints;
  if (!map.empty()) {
    find_spine(finder, joints);
    FIG_RETURN_IF_ERROR(apply_map(nodes, map, joints));
    for (const Wanted& joint : wanted_joints(0)) {
      if (!joint.needed || joints.has(joint.joint)) continue;
      best->missing = joint;
      best->count = 1;
      return missing_joint(nodes, *best);
    }
    joints.naming = "--map";
    const std::array<int, kJointCount> named = joints.node;
    find_spine(finder, joints);  // below the hips that the map may have changed
    for (const auto& [joint, name] : map) {
      const auto j = static_cast<size_t>(joint_number(joint));
      joints.node[j] = named[j];
    }
  } else {
    if (best->missing) return missing_joint(nodes, *best);
    find_spine(finder, joints);
  }
  drop_lone_fingers(joints);
  return joints;
}

}  // namespace figurine::ports
