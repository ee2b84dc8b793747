// A camera that goes along with the figures as they move, without knowing where they will go: from
// behind the moment by a time constant, where camera_path.h knows the whole way.
#pragma once

#include <array>

#include "figurine/camera.h"

namespace figurine::samples {

class FollowCamera {
 public:
  static constexpr double kTimeConstant_s = 0.4;
  static constexpr float kJump_m = 1;  // further in one frame is no step: a loop has begun again

  // start sees what it should while the figures are at place_m on the ground. Without follow it
  // stays.
  FollowCamera(const Camera& start, const std::array<float, 3>& place_m, bool follow)
      : start_(start),
        camera_(start),
        first_m_(place_m),
        at_m_(place_m),
        last_m_(place_m),
        follow_(follow) {}
  // The camera of a frame interval_s after the last one, the figures at place_m now. Heights do not
  // count.
  const Camera& step(const std::array<float, 3>& place_m, double interval_s);

 private:
  Camera start_, camera_;
  std::array<float, 3> first_m_, at_m_, last_m_;
  bool follow_;
};

}  // namespace figurine::samples
