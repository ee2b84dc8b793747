// The camera's world-to-view transform as a GLM matrix: GLM stores columns, a Camera rows.
#pragma once

#include <algorithm>
#include <glm/gtc/type_ptr.hpp>
#include <glm/matrix.hpp>

#include "figurine/camera.h"

namespace figurine::samples {

// Three columns of rotation and one of translation: view = matrix * vec4(world, 1).
inline glm::mat4x3 view_matrix(const Camera& camera) {
  return glm::transpose(glm::make_mat3x4(camera.view_from_world.data()));
}

inline void set_view_matrix(Camera& camera, const glm::mat4x3& matrix) {
  const glm::mat3x4 rows = glm::transpose(matrix);
  std::copy_n(glm::value_ptr(rows), camera.view_from_world.size(), camera.view_from_world.begin());
}

}  // namespace figurine::samples
