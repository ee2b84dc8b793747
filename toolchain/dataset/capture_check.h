// Whether cameras, poses and masks of a capture belong together: the posed body over its views.
//
// A view's body is drawn as a disc for every texel. Clothes and hair make the mask larger than the
// body, so an overlap of 0.6 to 0.85 is what good captures have; a wrong calibration, pose, frame
// number or person has less than half. docs/own_person.md says what to look at.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "ports/media/image.h"
#include "toolchain/dataset/dataset.h"

namespace figurine::dataset {

struct ViewCheck {
  size_t frame = 0, camera = 0;
  double overlap = 0;            // of body and mask: what both cover over what either does
  double body_in_mask = 0;       // share of the body's pixels
  double joints_in_mask = 0;     // share of the 22 body joints, of those that fall into the image
  double joint_distance_px = 0;  // mean over them, to the nearest pixel of the mask
  double sharpness = 0;          // variance of the Laplacian of the colours inside the mask, 8 bits
};

struct CameraCheck {
  size_t camera = 0;
  size_t views = 0;
  ViewCheck mean;       // frame and camera without meaning
  std::string trouble;  // empty: none; else what does not fit, for people
};

struct CaptureCheck {
  std::vector<ViewCheck> views;
  std::vector<CameraCheck> cameras;
  size_t misfits() const;  // cameras whose body does not lie on the mask (not the blurred ones)
};

// Of `frames` frames, spread over the capture (0: all), every view that has an image. draw, if
// given, gets every view with its body drawn over it: bones, joints, half transparent surface.
CaptureCheck check_capture(
    const Dataset& data, const Body& body, uint32_t frames,
    const std::function<void(const ViewCheck&, const ports::ImageU8&)>& draw);

}  // namespace figurine::dataset
