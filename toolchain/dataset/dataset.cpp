#include "toolchain/dataset/dataset.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>

#include "figurine/package.h"
#include "toolchain/dataset/layouts.h"
#include "toolchain/error.h"

namespace figurine::dataset {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kBlockFrames = 7;
constexpr uint32_t kInterleavedStride = 13;
constexpr uint32_t kHeldOutCameras = 4;

}  // namespace

const char* to_string(Role role) {
  switch (role) {
    case Role::kTrain:
      return "train";
    case Role::kHeldOutView:
      return "held-out view";
    case Role::kHeldOutPoseInterleaved:
      return "held-out pose, interleaved";
    case Role::kHeldOutPoseBlock:
      return "held-out pose, block";
    case Role::kHeldOutViewAndPose:
      return "held-out view and pose";
    case Role::kMissing:
      return "missing";
  }
  return "unknown";
}

Split default_split(uint32_t frame_count, uint32_t camera_count) {
  Split split;
  split.frames.assign(frame_count, FrameSplit::kTrain);
  const uint32_t block =
      frame_count < 2 * kBlockFrames ? 0 : std::min(kBlockFrames, frame_count / 6);
  const uint32_t first = frame_count * 2 / 3;
  for (uint32_t i = 0; i < block; ++i) split.frames[first + i] = FrameSplit::kBlock;
  uint32_t count = 0;
  for (FrameSplit& frame : split.frames) {
    if (frame == FrameSplit::kTrain && ++count % kInterleavedStride == 0)
      frame = FrameSplit::kInterleaved;
  }
  split.held_out_camera.assign(camera_count, false);
  const uint32_t held_out = std::min(kHeldOutCameras, camera_count / 6);
  for (uint32_t i = 0; i < held_out; ++i)
    split.held_out_camera[(2 * i + 1) * camera_count / (2 * held_out)] = true;
  return split;
}

ModelOrigin model_origin(const Package& body, const std::string& path) {
  ModelOrigin origin;
  if (body.body().name != "smplx") return origin;
  for (const KeyValue& setting : body.provenance().settings) {
    if (setting.key != kModelOriginSetting) continue;
    origin.smplx = true;
    const char* at = setting.value.c_str();
    for (double& value : origin.position_m) {
      char* end = nullptr;
      value = std::strtod(at, &end);
      if (end == at) throw InputError(path + ": " + kModelOriginSetting + ": is no position");
      at = end;
    }
    return origin;
  }
  throw InputError(path +
                   ": does not say where SMPL-X's origin is: made by a version before 0.2; "
                   "make it again by figurine-train body --smplx");
}

Dataset Dataset::open(const std::string& directory, const DatasetOptions& options) {
  const fs::path root(directory);
  if (!fs::is_directory(root)) throw InputError(directory + ": no such folder");
  Dataset set;
  if (fs::exists(root / "camera_intrinsics.json")) {
    set.parts_ = read_mvhumannet(directory, options);
  } else if (fs::exists(root / "intri.yml")) {
    set.parts_ = read_easymocap(directory, options);
  } else {
    throw InputError(
        directory +
        ": is no capture: has neither camera_intrinsics.json (MVHumanNet's layout) nor "
        "intri.yml (EasyMocap's)");
  }
  return set;
}

Role Dataset::role(size_t frame, size_t camera) const {
  const FrameSplit split = frames().at(frame).split;
  if (!has_image(frame, camera)) return Role::kMissing;
  if (cameras().at(camera).held_out)
    return split == FrameSplit::kTrain ? Role::kHeldOutView : Role::kHeldOutViewAndPose;
  switch (split) {
    case FrameSplit::kTrain:
      return Role::kTrain;
    case FrameSplit::kInterleaved:
      return Role::kHeldOutPoseInterleaved;
    case FrameSplit::kBlock:
      return Role::kHeldOutPoseBlock;
  }
  return Role::kTrain;
}

size_t Dataset::camera_with_image(size_t frame, size_t camera) const {
  for (size_t i = 0; i < cameras().size(); ++i) {
    const size_t candidate = (camera + i) % cameras().size();
    if (has_image(frame, candidate)) return candidate;
  }
  return camera;
}

namespace {

ports::ImageU8 straightened(ports::ImageU8 image, const std::string& path,
                            const CaptureCamera& capture) {
  const Camera& expected = capture.camera;
  if (image.width_px != expected.width_px || image.height_px != expected.height_px) {
    throw InputError(path + ": is " + std::to_string(image.width_px) + "x" +
                     std::to_string(image.height_px) + ", the camera's images are " +
                     std::to_string(expected.width_px) + "x" + std::to_string(expected.height_px));
  }
  return capture.lens.bends() ? undistort(image, expected, capture.lens) : std::move(image);
}

}  // namespace

std::vector<uint8_t> Dataset::load_mask(size_t frame, size_t camera) const {
  const std::string& path = mask_path(frame, camera);
  return straightened(read_mask(path), path, cameras()[camera]).pixels;
}

void Dataset::leave_out_blank_cameras() {
  std::string blank;
  size_t left = cameras().size();
  for (size_t c = 0; c < cameras().size(); ++c) {
    bool shows = false, any = false;
    for (size_t f = 0; f < frames().size() && !shows; ++f) {
      if (!has_image(f, c)) continue;
      any = true;
      const std::vector<uint8_t> mask = load_mask(f, c);
      shows = std::any_of(mask.begin(), mask.end(), [](uint8_t value) { return value >= 128; });
    }
    if (shows) continue;
    --left;
    if (!any) continue;
    blank += (blank.empty() ? "" : ", ") + cameras()[c].name;
    ++parts_.cameras_left_out;
    for (std::string& path : parts_.images[c]) path.clear();
  }
  if (left == 0)
    throw InputError(directory() + ": all masks are blank: they show nobody to learn from");
  if (!blank.empty())
    parts_.remarks.push_back("cameras of which all masks are blank, left out: " + blank);
}

CaptureImage Dataset::load_image(size_t frame, size_t camera) const {
  const CaptureCamera& capture = cameras().at(camera);
  const std::string& path = image_path(frame, camera);
  if (path.empty()) {
    throw InputError(directory() + ": camera " + capture.name + ": frame " +
                     std::to_string(frames()[frame].number) + ": missing");
  }
  ports::ImageU8 colour = straightened(read_colour(path), path, capture);
  CaptureImage image{capture.camera.width_px, capture.camera.height_px, std::move(colour.pixels),
                     load_mask(frame, camera)};
  if (parts_.composited_on_black) return image;
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    for (size_t c = 0; c < 3; ++c)
      image.rgb[i * 3 + c] =
          static_cast<uint8_t>((image.rgb[i * 3 + c] * image.alpha[i] + 127) / 255);
  }
  return image;
}

}  // namespace figurine::dataset
