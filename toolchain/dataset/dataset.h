// One identity of a multi-view capture as cameras, poses and images, in one of two layouts
// (docs/capture.md, docs/own_person.md):
//
// MVHumanNet's, real or of figurine-train capture (camera_intrinsics.json is there)
//   ID/images_lr/CAM/0005_img.jpg        colour, .jpg or .png; or images/
//   ID/fmask_lr/CAM/0005_img_fmask.png   foreground mask; soft alpha in our captures; or fmask/
//   ID/camera_extrinsics.json, ID/camera_intrinsics.json, ID/camera_scale.pkl
//   ID/smplx/smpl/000000.json            pose of frame 5: index = frame / 5 - 1
//   ID/figurine.json                     ours only: seed, body, shape, splits, framing, and full
//       poses (87 numbers cannot hold two hands)
//
// EasyMocap's (intri.yml is there)
//   ID/images/CAM/000000.jpg, ID/mask/CAM/000000.png, ID/intri.yml, ID/extri.yml
//   ID/output/smplx/000000.json          pose of frame 0; docs/own_person.md lists the folders
//
// What a user of such data stumbles over is handled here, once: units and sizes of intrinsics,
// lenses that bend (lens.h), Rh/Th about the origin and not the pelvis, bystanders, pictures of all
// kinds (picture_reader.h). What is left out is counted, and said in `remarks`. Nothing is cached:
// images are decoded when asked for.
//
// Based on: Xiong et al., MVHumanNet: A Large-scale Dataset of Multi-view Daily Dressing Human
// Captures, 2024; EasyMocap's documentation.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/body.h"
#include "figurine/camera.h"
#include "figurine/pose.h"
#include "toolchain/dataset/lens.h"
#include "toolchain/dataset/smplx_person.h"

namespace figurine {
class Package;
}

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
  kMissing,                 // there is no image, or its camera shows nobody: for nothing
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
  std::string name;  // folder below images_lr or images
  Camera camera;     // at the size of the stored images, without the lens's distortion
  bool held_out = false;
  Framing framing = Framing::kBody;  // where nothing is said, as in MVHumanNet, kBody
  Lens lens;                         // what load_image straightens
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
  // Of that body: where the origin of the model lies that Rh/Th turn about (model_origin).
  ModelOrigin origin;
};

// The key among a body package's settings, written by the importer of SMPL-X: "x y z", metres.
inline constexpr char kModelOriginSetting[] = "model_origin_m";

// Of a body package: its provenance says it where the body came from SMPL-X. Throws InputError for
// one of an older version, which does not.
ModelOrigin model_origin(const Package& body, const std::string& path);

// What the readers of the layouts fill in, and Dataset serves.
struct DatasetParts {
  std::string directory;
  std::vector<CaptureCamera> cameras;
  std::vector<std::vector<std::string>> images, masks;  // [V][F] paths; empty where there is none
  std::vector<CaptureFrame> frames;
  std::vector<float> shape;
  std::vector<std::string> sources, remarks;
  uint32_t frames_without_pose = 0, cameras_left_out = 0, images_left_out = 0;
  uint64_t seed = 0;
  std::string body_name, body_hash;
  bool composited_on_black = false;
};

class Dataset {
 public:
  // Reads and checks everything but the images: sizes, finite values, rotations, that every
  // camera's folder has the same image size, that cameras see the person. Throws InputError: "FILE:
  // FIELD: reason".
  static Dataset open(const std::string& directory, const DatasetOptions& options = {});

  const std::string& directory() const { return parts_.directory; }
  const std::vector<CaptureCamera>& cameras() const { return parts_.cameras; }
  const std::vector<CaptureFrame>& frames() const { return parts_.frames; }
  const std::vector<float>& shape() const {
    return parts_.shape;
  }  // [20] of our captures, [10] of MVHumanNet's
  Role role(size_t frame, size_t camera) const;

  bool has_image(size_t frame, size_t camera) const { return !image_path(frame, camera).empty(); }

  // Left out of the lists above: frames that have images but no usable pose file, cameras that are
  // known to be wrong or show nobody. And single images that are not there, or have no mask.
  uint32_t frames_without_pose() const { return parts_.frames_without_pose; }
  uint32_t cameras_left_out() const { return parts_.cameras_left_out; }
  uint32_t images_left_out() const { return parts_.images_left_out; }
  // All of that, and what was taken for granted, a line each: for people.
  const std::vector<std::string>& remarks() const { return parts_.remarks; }

  uint64_t seed() const { return parts_.seed; }  // 0 where there is no figurine.json
  const std::string& body_name() const {
    return parts_.body_name;
  }  // empty where there is no figurine.json
  const std::string& body_hash() const {
    return parts_.body_hash;
  }  // empty where there is no figurine.json
  const std::vector<std::string>& sources() const {
    return parts_.sources;
  }  // data it was made from, with licences; empty where there is no figurine.json

  // Decodes masks until every camera has shown somebody: one of which all masks are blank shows
  // nothing from then on (Role::kMissing, and a remark). Throws InputError if none is left. Before
  // long work; nothing else decodes masks before they are asked for.
  void leave_out_blank_cameras();

  // Decodes image and mask. May be called from several threads. Throws InputError on a missing or
  // damaged file or one of another size.
  // Throws InputError, too, where there is none.
  CaptureImage load_image(size_t frame, size_t camera) const;
  // The first of a frame's images from `camera` on that is there; all cameras round.
  size_t camera_with_image(size_t frame, size_t camera) const;
  // Empty where there is none.
  const std::string& image_path(size_t frame, size_t camera) const {
    return parts_.images.at(camera).at(frame);
  }
  const std::string& mask_path(size_t frame, size_t camera) const {
    return parts_.masks.at(camera).at(frame);
  }

 private:
  Dataset() = default;
  std::vector<uint8_t> load_mask(size_t frame, size_t camera) const;

  DatasetParts parts_;
};

}  // namespace figurine::dataset
