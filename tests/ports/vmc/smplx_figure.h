// A made-up body of the 55 joints of SMPL-X for the tests of ports/vmc: arms that hang at 45
// degrees, elbows and knees a little bent, hands turned, feet outwards. Nothing but joints.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "figurine/pose.h"

namespace figurine::tests {

class SmplxFigure {
 public:
  SmplxFigure() {
    add("pelvis", "", 0, 0.95f, 0);
    for (const float side : {1.0f, -1.0f}) {
      const std::string s = side > 0 ? "left_" : "right_";
      add(s + "hip", "pelvis", side * 0.09f, -0.06f, 0);
      add(s + "knee", s + "hip", side * 0.02f, -0.40f, 0.01f);
      add(s + "ankle", s + "knee", side * 0.01f, -0.41f, -0.03f);
      add(s + "foot", s + "ankle", side * 0.03f, -0.06f, 0.12f);
    }
    add("spine1", "pelvis", 0, 0.10f, -0.01f);
    add("spine2", "spine1", 0, 0.13f, 0.01f);
    add("spine3", "spine2", 0, 0.12f, 0);
    add("neck", "spine3", 0, 0.20f, -0.02f);
    add("head", "neck", 0, 0.09f, 0.02f);
    add("jaw", "head", 0, 0.02f, 0.03f);
    for (const float side : {1.0f, -1.0f}) {
      const std::string s = side > 0 ? "left_" : "right_";
      add(s + "eye", "head", side * 0.03f, 0.07f, 0.08f);
      add(s + "collar", "spine3", side * 0.04f, 0.11f, 0);
      add(s + "shoulder", s + "collar", side * 0.13f, 0.02f, -0.01f);
      add(s + "elbow", s + "shoulder", side * 0.20f, -0.19f, -0.01f);
      add(s + "wrist", s + "elbow", side * 0.17f, -0.16f, 0.06f);
      const struct {
        const char* name;
        float x, y, z;
      } fingers[] = {{"index", 0.08f, -0.05f, 0.05f},
                     {"middle", 0.09f, -0.06f, 0.03f},
                     {"pinky", 0.08f, -0.07f, -0.02f},
                     {"ring", 0.09f, -0.06f, 0.0f},
                     {"thumb", 0.02f, -0.03f, 0.05f}};
      for (const auto& finger : fingers) {
        const std::string f = s + finger.name;
        add(f + "1", s + "wrist", side * finger.x, finger.y, finger.z);
        add(f + "2", f + "1", side * 0.3f * finger.x, 0.4f * finger.y, 0.4f * finger.z);
        add(f + "3", f + "2", side * 0.2f * finger.x, 0.4f * finger.y, 0.2f * finger.z);
      }
    }
  }

  const std::vector<std::string>& names() const { return names_; }
  SkeletonView rest() const { return {parents_, positions_}; }
  size_t joint(const std::string& name) const { return numbers_.at(name); }
  size_t count() const { return names_.size(); }

 private:
  void add(const std::string& name, const std::string& parent, float x, float y, float z) {
    const int on = parent.empty() ? -1 : static_cast<int>(numbers_.at(parent));
    const float place[3] = {x, y, z};
    for (int k = 0; k < 3; ++k)
      positions_.push_back(place[k] +
                           (on < 0 ? 0 : positions_[3 * static_cast<size_t>(on) + size_t(k)]));
    parents_.push_back(static_cast<int16_t>(on));
    numbers_[name] = names_.size();
    names_.push_back(name);
  }

  std::vector<std::string> names_;
  std::vector<int16_t> parents_;
  std::vector<float> positions_;
  std::map<std::string, size_t> numbers_;
};

}  // namespace figurine::tests
