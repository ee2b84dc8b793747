// Quaternions of poses (wxyz in memory) as GLM's, for arithmetic.
#pragma once

#include <glm/gtc/quaternion.hpp>

namespace figurine::samples {

inline glm::quat quaternion_at(const float* wxyz) {
  return glm::quat(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);  // GLM's constructor takes w first
}

inline void store_quaternion(const glm::quat& q, float* wxyz) {
  wxyz[0] = q.w, wxyz[1] = q.x, wxyz[2] = q.y, wxyz[3] = q.z;
}

// By angle about a unit axis. Sine and cosine in double, then rounded once.
inline glm::quat rotation_about(const glm::dvec3& axis, double angle_rad) {
  return glm::quat(glm::angleAxis(angle_rad, axis));
}

}  // namespace figurine::samples
