// A pinhole camera in OpenCV axes: x right, y down, z forward; pixel centres at +0.5; metres.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/status.h"

namespace figurine {

struct Camera {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
  float fx_px = 0, fy_px = 0;  // focal lengths
  float cx_px = 0, cy_px = 0;  // principal point; the image centre is (width/2, height/2)
  // [3,4] row-major, x_view = R x_world + t. R is a rotation.
  std::array<float, 12> view_from_world{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  float near_m = 0.2f;  // Gaussians whose centre has view z <= near are culled (0.2 in the original
                        // 3DGS; close avatars want less)
};

// Positive finite focal lengths, 1 <= size <= 16384, finite transform whose rotation part is
// orthonormal to 1e-3, near > 0.
Status validate_camera(const Camera& camera);

struct OrbitCamera {
  float azimuth_deg = 0;    // 0 looks at the front of a figure that faces +z; positive moves the
                            // camera to the figure's left (+x)
  float elevation_deg = 0;  // positive moves the camera up; within [-90, 90]
  float distance_m = 3;
  float vertical_fov_deg = 40;  // 1 to 170
  std::array<float, 3> target_m{0, 0, 0};
};

// A camera on a sphere around the target, looking at it, y up; straight from above, what lies away
// from an orbit of the same azimuth is on top. Errors: kInvalidArgument on anything outside the
// ranges above.
Result<Camera> make_orbit_camera(const OrbitCamera& orbit, uint32_t width_px, uint32_t height_px);

}  // namespace figurine
