// From a covariance factor F (covariance F F^T, F any 3x3 matrix) to what files of Gaussians store:
// three standard deviations and a rotation.
#pragma once

#include <array>

namespace figurine::ports {

struct ScaleRotation {
  std::array<double, 3> scale;       // singular values of F, descending, >= 0
  std::array<double, 4> quaternion;  // unit, wxyz, w >= 0; its columns are the covariance's axes
};

// F F^T = R diag(scale^2) R^T. F must be finite. Never forms F F^T: small axes of needles and discs
// keep their relative accuracy.
ScaleRotation decompose(const float* factor);  // [9] row-major

}  // namespace figurine::ports
