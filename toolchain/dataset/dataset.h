// Reads one identity of a multi-view capture in MVHumanNet's layout, real or of figurine-train
// capture (docs/capture.md), as cameras, poses and images.
//
//   ID/images_lr/CAM/0005_img.jpg        colour, at half the size that camera_intrinsics.json
//       speaks of
//   ID/fmask_lr/CAM/0005_img_fmask.png   foreground mask; soft alpha in our captures
//   ID/camera_extrinsics.json, ID/camera_intrinsics.json, ID/camera_scale.pkl
//   ID/smplx/smpl/000000.json            pose of frame 5: index = frame / 5 - 1
//   ID/figurine.json                     ours only: seed, body, shape, splits, framing, and full
//       poses (87 numbers cannot hold two hands)
//
// What a user of that data set stumbles over is handled here, once: intrinsics are halved,
// translations are multiplied by the camera scale (a pickled float, parsed without unpickling),
// Rh/Th rotate about the origin and not the pelvis, camera 41 is wrong, frames without a pose are
// left out and counted. Nothing is cached: images are decoded when asked for.
//
// Based on: Xiong et al., MVHumanNet: A Large-scale Dataset of Multi-view Daily Dressing Human
// Captures, 2024.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "figurine/pose.h"

namespace figurine::dataset {

inline constexpr uint32_t kFrameStep = 5;     // file names count in fives
inline constexpr uint32_t kSmplxJoints = 55;  // joint order: SMPL-X

// What an image is for. A held-out camera is held out at every frame; a held-out pose at every
// camera.
enum class Role : uint8_t {
  kTrain,                   // training camera, training pose
  kHeldOutView,             // held-out camera, training pose
  kHeldOutPoseInterleaved,  // training camera, a pose between training poses
  kHeldOutPoseBlock,        // training camera, a pose of a run that is far from all training poses
  kHeldOutViewAndPose,      // both held out
};
const char* to_string(Role role);

// How much of the person a camera holds: everything in every pose, or head and shoulders, whatever
// the image's border cuts off.
enum class Framing : uint8_t { kBody, kBust };

enum class FrameSplit : uint8_t { kTrain, kInterleaved, kBlock };

// Which frames and cameras are held out. The same rule serves captures and data without
// figurine.json: a block of 7 consecutive frames at two thirds of the sequence, every 13th of the
// others, and 4 cameras spread over the list (fewer where there are few: one in six, one in
// thirteen). Captures apply it to the cameras of each framing by themselves.
struct Split {
  std::vector<FrameSplit> frames;     // [F]
  std::vector<bool> held_out_camera;  // [V]
};
Split default_split(uint32_t frame_count, uint32_t camera_count);

struct CaptureCamera {
  std::string name;  // folder below images_lr
  Camera camera;     // at the size of the stored images
  bool held_out = false;
  Framing framing = Framing::kBody;  // where nothing is said, as in MVHumanNet, kBody
};

struct CaptureFrame {
  uint32_t number = 0;  // as in the file names: 5, 10, 15, ...
  FrameSplit split = FrameSplit::kTrain;
  std::array<float, 3> root_translation_m{
      0, 0, 0};  // of the root joint from its rest position in the person's own shape
  std::vector<float> rotations;  // [J,4] unit quaternions, wxyz, J = 55

  PoseView pose() const { return {root_translation_m, rotations}; }
};

// One decoded image. Colour is sRGB-encoded as stored and premultiplied: what lies outside the
// person is black.
struct CaptureImage {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
  std::vector<uint8_t> rgb;    // [H,W,3]
  std::vector<uint8_t> alpha;  // [H,W] coverage, 255 inside
};

struct DatasetOptions {
  // Needed where there is no figurine.json: the root joint's rest position of the person's shape
  // turns Rh/Th into a pose. Must have 55 joints.
  const Body* body = nullptr;
  // Content hash of the body package (format_hash). If given, and the capture names its body, both
  // must be equal, or `body` have the skeleton that the capture names (skeleton_hash.h).
  std::string body_hash;
};

class Dataset {
 public:
  // Reads and checks everything but the images: sizes, finite values, rotations, that every
  // camera's folder has the same image size and every frame its files. Throws InputError: "FILE:
  // FIELD: reason".
  static Dataset open(const std::string& directory, const DatasetOptions& options = {});

  const std::string& directory() const { return directory_; }
  const std::vector<CaptureCamera>& cameras() const { return cameras_; }
  const std::vector<CaptureFrame>& frames() const { return frames_; }
  const std::vector<float>& shape() const {
    return shape_;
  }  // [20] of our captures, [10] of MVHumanNet's
  Role role(size_t frame, size_t camera) const;

  // Frames that have images but no usable pose file, and cameras that are known to be wrong: left
  // out of the lists above.
  uint32_t frames_without_pose() const { return frames_without_pose_; }
  uint32_t cameras_left_out() const { return cameras_left_out_; }

  uint64_t seed() const { return seed_; }  // 0 where there is no figurine.json
  const std::string& body_name() const {
    return body_name_;
  }  // empty where there is no figurine.json
  const std::string& body_hash() const {
    return body_hash_;
  }  // empty where there is no figurine.json
  const std::vector<std::string>& sources() const {
    return sources_;
  }  // data it was made from, with licences; empty where there is no figurine.json

  // Decodes image and mask. May be called from several threads. Throws InputError on a missing or
  // damaged file or one of another size.
  CaptureImage load_image(size_t frame, size_t camera) const;
  std::string image_path(size_t frame, size_t camera) const;
  std::string mask_path(size_t frame, size_t camera) const;

 private:
  class Reading;  // what open() does, step by step

  Dataset() = default;

  std::string directory_;
  std::vector<CaptureCamera> cameras_;
  std::vector<std::vector<std::string>> image_files_,
      mask_files_;  // [V][F] names below the camera's folder
  std::vector<CaptureFrame> frames_;
  std::vector<float> shape_;
  std::vector<std::string> sources_;
  uint32_t frames_without_pose_ = 0;
  uint32_t cameras_left_out_ = 0;
  uint64_t seed_ = 0;
  std::string body_name_;
  std::string body_hash_;
  bool composited_on_black_ = false;
};

}  // namespace figurine::dataset
