// Whom a person looks at: how straight the face of a captured frame is turned to a camera.
#pragma once

#include "figurine/body.h"
#include "toolchain/dataset/dataset.h"

namespace figurine::train {

// The cosine between the head's forward axis (+z at rest) and the way back along the camera's axis:
// 1 is a frontal face, level with the camera. The body must have SMPL-X's joints.
float facing(const Body& body, const dataset::CaptureFrame& frame, const Camera& camera);

}  // namespace figurine::train
