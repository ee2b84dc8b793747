#include "toolchain/dataset/dataset.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>

#include "ports/host/files.h"
#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "toolchain/dataset/json_fields.h"
#include "toolchain/dataset/skeleton_hash.h"
#include "toolchain/error.h"

namespace figurine::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr uint32_t kWrongCamera = 41;  // MVHumanNet's own calibration of it is off
constexpr uint32_t kBlockFrames = 7;
constexpr uint32_t kInterleavedStride = 13;
constexpr uint32_t kHeldOutCameras = 4;
constexpr size_t kSmplxPoseNumbers = 87;

ports::MappedFile map_file(const std::string& path) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) throw InputError(file.status().message());
  return std::move(file).value();
}

json read_json(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  const auto* text = reinterpret_cast<const char*>(file.bytes().data());
  json value = json::parse(text, text + file.bytes().size(), nullptr, false);
  if (value.is_discarded()) throw InputError(path + ": not valid JSON");
  return value;
}

// A pickle that holds one float, and nothing else: protocol and frame headers, the number, the
// stop. A pickle is a program; this is no interpreter.
double read_pickled_float(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  const auto* p = reinterpret_cast<const uint8_t*>(file.bytes().data());
  const uint8_t* end = p + file.bytes().size();
  const auto need = [&](std::ptrdiff_t count) {
    if (end - p < count) throw InputError(path + ": pickle ends early");
  };
  std::optional<double> value;
  for (;;) {
    need(1);
    const uint8_t opcode = *p++;
    if (opcode == 0x80) {  // PROTO version
      need(1);
      ++p;
    } else if (opcode == 0x95) {  // FRAME length
      need(8);
      p += 8;
    } else if (opcode == 0x94) {           // MEMOIZE
    } else if (opcode == 'G' && !value) {  // BINFLOAT, big-endian
      need(8);
      uint64_t bits = 0;
      for (int i = 0; i < 8; ++i) bits = bits << 8 | *p++;
      value = std::bit_cast<double>(bits);
    } else if (opcode == 'F' && !value) {  // FLOAT, a line of text
      const auto* line_end =
          static_cast<const uint8_t*>(std::memchr(p, '\n', static_cast<size_t>(end - p)));
      if (line_end == nullptr) throw InputError(path + ": pickle ends early");
      const std::string text(p, line_end);
      char* stop = nullptr;
      value = std::strtod(text.c_str(), &stop);
      if (text.empty() || *stop != '\0') throw InputError(path + ": camera scale is not a number");
      p = line_end + 1;
    } else if (opcode == '.' && value) {
      break;
    } else {
      throw InputError(path + ": holds something else than one pickled float (opcode " +
                       std::to_string(opcode) + ")");
    }
  }
  if (!std::isfinite(*value) || *value <= 0)
    throw InputError(path + ": camera scale must be positive and finite");
  return *value;
}

// The leading digits of a file name: 5 of "0005_img.jpg". Nothing if there are none or too many.
std::optional<uint32_t> leading_number(const std::string& name) {
  size_t digits = 0;
  while (digits < name.size() && name[digits] >= '0' && name[digits] <= '9') ++digits;
  if (digits == 0 || digits > 9) return std::nullopt;
  return static_cast<uint32_t>(std::stoul(name.substr(0, digits)));
}

// Files of a folder with one extension, by their leading number.
std::map<uint32_t, std::string> numbered_files(const std::string& directory,
                                               const std::string& extension) {
  std::map<uint32_t, std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (!name.ends_with(extension)) continue;
    const std::optional<uint32_t> number = leading_number(name);
    if (!number) continue;
    if (!files.emplace(*number, name).second)
      throw InputError(directory + ": two files of number " + std::to_string(*number));
  }
  if (error) throw InputError(directory + ": " + error.message());
  return files;
}

Camera read_camera(const JsonField& extrinsics, const std::vector<double>& intrinsics, double scale,
                   ports::JpegSize size) {
  Camera camera;
  camera.width_px = size.width_px;
  camera.height_px = size.height_px;
  camera.fx_px = static_cast<float>(intrinsics[0] / 2);
  camera.fy_px = static_cast<float>(intrinsics[4] / 2);
  camera.cx_px = static_cast<float>(intrinsics[2] / 2);
  camera.cy_px = static_cast<float>(intrinsics[5] / 2);
  const std::vector<double> rotation = extrinsics["rotation"].numbers(9);
  const std::vector<double> translation = extrinsics["translation"].numbers(3);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      camera.view_from_world[row * 4 + column] = static_cast<float>(rotation[row * 3 + column]);
    camera.view_from_world[row * 4 + 3] = static_cast<float>(translation[row] * scale);
  }
  throw_if_error(validate_camera(camera), extrinsics.where());
  return camera;
}

// The unit quaternion (wxyz) of a rotation vector.
std::array<double, 4> quaternion_from_rotation_vector(const double* v) {
  const double angle = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const double s = angle < 1e-8 ? 0.5 : std::sin(angle / 2) / angle;
  return {std::cos(angle / 2), s * v[0], s * v[1], s * v[2]};
}

std::array<double, 4> multiply(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

std::array<double, 3> rotate(const std::array<double, 4>& q, const std::array<double, 3>& v) {
  const std::array<double, 4> r =
      multiply(multiply(q, {0, v[0], v[1], v[2]}), {q[0], -q[1], -q[2], -q[3]});
  return {r[1], r[2], r[3]};
}

struct SmplxPose {
  std::array<double, 4> rotation;       // of Rh
  std::array<double, 3> translation_m;  // Th
  std::vector<double> poses;            // [87]
  std::vector<float> shapes;            // [10]
};

SmplxPose read_smplx(const std::string& path) {
  const json value = read_json(path);
  const std::vector<JsonField> people = JsonField(value, path + ": ").items();
  if (people.empty()) throw InputError(path + ": no person in it");
  const JsonField& person = people[0];
  SmplxPose pose;
  pose.rotation = quaternion_from_rotation_vector(person["Rh"].numbers(3).data());
  const std::vector<double> th = person["Th"].numbers(3);
  pose.translation_m = {th[0], th[1], th[2]};
  pose.poses = person["poses"].numbers(kSmplxPoseNumbers);
  for (double s : person["shapes"].numbers(10)) pose.shapes.push_back(static_cast<float>(s));
  return pose;
}

// World point = R(Rh) (posed by `poses`, root at its rest position) + Th: a rotation about the
// origin. Our root turns about its own joint r:
//   R (x - r) + r + t = R x + Th   =>   t = R r - r + Th.
// Hands stay at rest: the 6 + 6 numbers are coefficients of SMPL-X's hand components, which the
// data set does not hold.
void set_pose(const SmplxPose& smplx, const std::array<double, 3>& root_rest_m,
              CaptureFrame& frame) {
  frame.rotations.assign(kSmplxJoints * 4, 0.0f);
  for (uint32_t j = 0; j < kSmplxJoints; ++j) frame.rotations[j * 4] = 1;
  const auto set = [&](uint32_t joint, const std::array<double, 4>& q) {
    for (int i = 0; i < 4; ++i) frame.rotations[joint * 4 + i] = static_cast<float>(q[i]);
  };
  set(0, multiply(smplx.rotation, quaternion_from_rotation_vector(&smplx.poses[0])));
  for (uint32_t j = 1; j < 22; ++j) set(j, quaternion_from_rotation_vector(&smplx.poses[j * 3]));
  for (uint32_t j = 0; j < 3; ++j)
    set(22 + j,
        quaternion_from_rotation_vector(&smplx.poses[78 + j * 3]));  // jaw, left eye, right eye
  const std::array<double, 3> turned = rotate(smplx.rotation, root_rest_m);
  for (int i = 0; i < 3; ++i)
    frame.root_translation_m[i] =
        static_cast<float>(turned[i] - root_rest_m[i] + smplx.translation_m[i]);
}

std::array<double, 3> root_rest_position(const Body& body, const std::vector<float>& shape) {
  std::array<double, 3> root{body.joint_position_m[0], body.joint_position_m[1],
                             body.joint_position_m[2]};
  const size_t used = std::min<size_t>(shape.size(), body.shape_count());
  for (size_t s = 0; s < used; ++s) {
    for (int i = 0; i < 3; ++i)
      root[i] += double{shape[s]} * body.joint_shape_basis_m[s * body.joint_count() * 3 + i];
  }
  return root;
}

FrameSplit parse_split(const JsonField& field) {
  const std::string text = field.text();
  if (text == "train") return FrameSplit::kTrain;
  if (text == "interleaved") return FrameSplit::kInterleaved;
  if (text == "block") return FrameSplit::kBlock;
  field.fail("unknown split '" + text + "'");
}

std::string frame_label(uint32_t number) {
  char text[16];
  std::snprintf(text, sizeof text, "%04u", number);
  return text;
}

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

// The steps of open(), in their order. Each fills a part of the set or throws; what one step learns
// that a later one needs, and the set does not, lives here.
class Dataset::Reading {
 public:
  Reading(const std::string& directory, const DatasetOptions& options)
      : root_(directory),
        options_(options),
        own_path_((root_ / "figurine.json").string()),
        own_(fs::exists(own_path_)),
        own_json_(own_ ? read_json(own_path_) : json::object()),
        about_(own_json_, own_path_ + ": ") {
    set_.directory_ = directory;
  }

  Dataset run() {
    if (own_) read_own_description();
    check_body();
    read_cameras();
    read_frames();
    match_files();
    if (own_) {
      take_marked_cameras();
    } else {
      split_by_rule();
    }
    return std::move(set_);
  }

 private:
  // Number, then the camera's key and folder.
  using CameraNames = std::map<uint32_t, std::pair<std::string, std::string>>;
  using NumberedFiles = std::map<uint32_t, std::string>;

  // figurine.json carries what the layout cannot.
  void read_own_description() {
    if (about_["version"].whole() != 1)
      about_["version"].fail("unknown version; this build reads 1");
    if (!about_["complete"].boolean())
      throw InputError(own_path_ +
                       ": complete: the capture was interrupted; finish it with --resume");
    set_.seed_ = about_["seed"].whole();
    set_.body_name_ = about_["body"]["name"].text();
    set_.body_hash_ = about_["body"]["hash"].text();
    for (double s : about_["shape"].numbers()) set_.shape_.push_back(static_cast<float>(s));
    for (const JsonField& source : about_["sources"].items())
      set_.sources_.push_back(source.text());
    const std::string background = about_["background"].text();
    if (background != "black") about_["background"].fail("unknown background '" + background + "'");
    set_.composited_on_black_ = true;
  }

  void check_body() const {
    if (own_ && !options_.body_hash.empty() && options_.body_hash != set_.body_hash_ &&
        !has_skeleton_of_body()) {
      about_["body"]["hash"].fail("captured with body " + set_.body_hash_ +
                                  ", but the given body is " + options_.body_hash);
    }
    if (!own_ && options_.body == nullptr) {
      throw InputError(
          set_.directory_ +
          ": has no figurine.json, so its poses need a body (the pelvis' rest position)");
    }
    if (options_.body != nullptr && options_.body->joint_count() != kSmplxJoints) {
      throw InputError(set_.directory_ + ": needs a body of 55 joints, the given one has " +
                       std::to_string(options_.body->joint_count()));
    }
  }

  // Captures of before the field stand for their own body alone.
  bool has_skeleton_of_body() const {
    return options_.body != nullptr && about_["body"].has("skeleton") &&
           about_["body"]["skeleton"].text() == skeleton_hash(*options_.body);
  }

  void read_cameras() {
    const std::string intrinsics_path = (root_ / "camera_intrinsics.json").string();
    const json intrinsics_json = read_json(intrinsics_path);
    const std::vector<double> intrinsics =
        JsonField(intrinsics_json, intrinsics_path + ": ")["intrinsics"].numbers(9);
    const double scale = read_pickled_float((root_ / "camera_scale.pkl").string());
    const std::string extrinsics_path = (root_ / "camera_extrinsics.json").string();
    const json extrinsics_json = read_json(extrinsics_path);
    const JsonField extrinsics(extrinsics_json, extrinsics_path + ": ");
    for (const auto& [number, key_and_name] : camera_names(extrinsics_json, extrinsics_path)) {
      const auto& [key, name] = key_and_name;
      if (number == kWrongCamera || (!own_ && !fs::is_directory(image_folder(name)))) {
        ++set_.cameras_left_out_;
        continue;
      }
      const ports::JpegSize size = list_images(name);
      CaptureCamera camera{name, read_camera(extrinsics[key], intrinsics, scale, size)};
      if (own_) scale_intrinsics(camera.camera);
      check_principal_point(camera, intrinsics_path);
      set_.cameras_.push_back(std::move(camera));
    }
    if (set_.cameras_.empty()) throw InputError(set_.directory_ + ": no usable camera");
  }

  // The intrinsics are those of images of the size that the description names; close-ups have the
  // same lens and may have images of another size.
  void scale_intrinsics(Camera& camera) const {
    if (!about_.has("bust_cameras")) return;
    const double width = about_["image"]["width"].number(),
                 height = about_["image"]["height"].number();
    if (!(width >= 1 && height >= 1)) about_["image"].fail("not the size of an image");
    camera.fx_px = static_cast<float>(camera.fx_px * camera.width_px / width);
    camera.cx_px = static_cast<float>(camera.cx_px * camera.width_px / width);
    camera.fy_px = static_cast<float>(camera.fy_px * camera.height_px / height);
    camera.cy_px = static_cast<float>(camera.cy_px * camera.height_px / height);
  }

  // A camera's key is "NUMBER_NAME.png".
  static CameraNames camera_names(const json& extrinsics, const std::string& path) {
    if (!extrinsics.is_object()) throw InputError(path + ": not an object of cameras");
    CameraNames names;
    for (const auto& [key, value] : extrinsics.items()) {
      const std::optional<uint32_t> number = leading_number(key);
      const size_t underscore = key.find('_');
      if (!number || underscore == std::string::npos || underscore + 1 == key.size())
        throw InputError(path + ": " + key + ": a camera is called NUMBER_NAME.png");
      std::string name = key.substr(underscore + 1);
      if (name.ends_with(".png")) name.resize(name.size() - 4);
      if (name.find('/') != std::string::npos || name == "..")
        throw InputError(path + ": " + key + ": not a folder's name");
      if (!names.emplace(*number, std::pair(key, name)).second)
        throw InputError(path + ": two cameras of number " + std::to_string(*number));
    }
    return names;
  }

  fs::path image_folder(const std::string& camera) const { return root_ / "images_lr" / camera; }

  // Notes a camera's images and masks; the size of the first image.
  ports::JpegSize list_images(const std::string& camera) {
    const fs::path folder = image_folder(camera);
    images_.push_back(numbered_files(folder.string(), ".jpg"));
    masks_.push_back(numbered_files((root_ / "fmask_lr" / camera).string(), ".png"));
    if (images_.back().empty()) throw InputError(folder.string() + ": no images");
    const std::string first = (folder / images_.back().begin()->second).string();
    const Result<ports::JpegSize> size = ports::decode_jpeg_size(map_file(first).bytes(), first);
    if (!size.ok()) throw InputError(size.status().message());
    return *size;
  }

  // The images are half the size that the intrinsics speak of: a principal point outside the image
  // shows data of another size.
  static void check_principal_point(const CaptureCamera& capture,
                                    const std::string& intrinsics_path) {
    const Camera& camera = capture.camera;
    if (camera.cx_px > 0 && camera.cx_px < camera.width_px && camera.cy_px > 0 &&
        camera.cy_px < camera.height_px)
      return;
    throw InputError(intrinsics_path +
                     ": intrinsics: principal point, halved, is outside the images of " +
                     capture.name + " (" + std::to_string(camera.width_px) + "x" +
                     std::to_string(camera.height_px) + ")");
  }

  // Frames are the first camera's image numbers that have a pose.
  void read_frames() {
    const std::map<uint32_t, JsonField> own_frames =
        own_ ? list_own_frames() : std::map<uint32_t, JsonField>();
    for (const auto& [number, file] : images_[0]) {
      CaptureFrame frame;
      frame.number = number;
      const bool posed = own_ ? read_own_pose(own_frames, frame) : read_smplx_pose(frame);
      if (posed) {
        set_.frames_.push_back(std::move(frame));
      } else {
        ++set_.frames_without_pose_;
      }
    }
    if (set_.frames_.empty())
      throw InputError(set_.directory_ + ": no frame has both image and pose");
    if (own_ && set_.frames_.size() != own_frames.size()) {
      throw InputError(own_path_ + ": frames: names " + std::to_string(own_frames.size()) +
                       ", but only " + std::to_string(set_.frames_.size()) + " have images");
    }
  }

  std::map<uint32_t, JsonField> list_own_frames() const {
    std::map<uint32_t, JsonField> frames;
    for (const JsonField& frame : about_["frames"].items()) {
      const uint64_t number = frame["number"].whole();
      if (number == 0 || number > 999'999'999) frame["number"].fail("out of range");
      if (!frames.emplace(static_cast<uint32_t>(number), frame).second)
        frame["number"].fail("stands twice");
    }
    return frames;
  }

  // False if figurine.json does not name this frame.
  static bool read_own_pose(const std::map<uint32_t, JsonField>& own_frames, CaptureFrame& frame) {
    const auto found = own_frames.find(frame.number);
    if (found == own_frames.end()) return false;
    const JsonField& field = found->second;
    frame.split = parse_split(field["split"]);
    const std::vector<double> translation = field["root_translation_m"].numbers(3);
    for (int i = 0; i < 3; ++i) frame.root_translation_m[i] = static_cast<float>(translation[i]);
    for (double q : field["rotations"].numbers(kSmplxJoints * 4))
      frame.rotations.push_back(static_cast<float>(q));
    throw_if_error(validate_pose(frame.pose(), kSmplxJoints), field["rotations"].where());
    return true;
  }

  // False if the data set has no pose of this frame. The person's shape is the first frame's.
  bool read_smplx_pose(CaptureFrame& frame) {
    const uint32_t index = frame.number / kFrameStep;
    if (frame.number % kFrameStep != 0 || index == 0) return false;
    const std::string digits = std::to_string(index - 1);
    const std::string file =
        std::string(6 - std::min<size_t>(6, digits.size()), '0') + digits + ".json";
    const std::string path = (root_ / "smplx" / "smpl" / file).string();
    if (!fs::exists(path)) return false;
    const SmplxPose smplx = read_smplx(path);
    if (set_.shape_.empty()) set_.shape_ = smplx.shapes;
    set_pose(smplx, root_rest_position(*options_.body, set_.shape_), frame);
    return true;
  }

  // Image and mask of every frame and camera.
  void match_files() {
    for (size_t c = 0; c < set_.cameras_.size(); ++c) {
      std::vector<std::string>& image_files = set_.image_files_.emplace_back();
      std::vector<std::string>& mask_files = set_.mask_files_.emplace_back();
      for (const CaptureFrame& frame : set_.frames_) {
        const auto file_of = [&](const NumberedFiles& files, const char* folder) {
          const auto found = files.find(frame.number);
          if (found != files.end()) return found->second;
          throw InputError((root_ / folder / set_.cameras_[c].name).string() + ": frame " +
                           frame_label(frame.number) + ": missing");
        };
        image_files.push_back(file_of(images_[c], "images_lr"));
        mask_files.push_back(file_of(masks_[c], "fmask_lr"));
      }
    }
  }

  // Which cameras are held out, and which hold head and shoulders only (captures from before there
  // were such cameras say nothing of them).
  void take_marked_cameras() {
    mark_cameras("held_out_cameras", [](CaptureCamera& camera) { camera.held_out = true; });
    if (about_.has("bust_cameras")) {
      mark_cameras("bust_cameras", [](CaptureCamera& camera) { camera.framing = Framing::kBust; });
    }
  }

  // mark(camera) for every camera that the field names.
  template <class Mark>
  void mark_cameras(const char* field, const Mark& mark) {
    for (const JsonField& name : about_[field].items()) {
      const std::string wanted = name.text();
      const auto found =
          std::find_if(set_.cameras_.begin(), set_.cameras_.end(),
                       [&](const CaptureCamera& camera) { return camera.name == wanted; });
      if (found == set_.cameras_.end()) about_[field].fail("no camera is called '" + wanted + "'");
      mark(*found);
    }
  }

  void split_by_rule() {
    const Split split = default_split(static_cast<uint32_t>(set_.frames_.size()),
                                      static_cast<uint32_t>(set_.cameras_.size()));
    for (size_t f = 0; f < set_.frames_.size(); ++f) set_.frames_[f].split = split.frames[f];
    for (size_t c = 0; c < set_.cameras_.size(); ++c)
      set_.cameras_[c].held_out = split.held_out_camera[c];
  }

  const fs::path root_;
  const DatasetOptions& options_;
  const std::string own_path_;
  const bool own_;  // made by figurine-train capture
  const json own_json_;
  const JsonField about_;
  std::vector<NumberedFiles> images_, masks_;  // [V]
  Dataset set_;
};

Dataset Dataset::open(const std::string& directory, const DatasetOptions& options) {
  if (!fs::is_directory(directory)) throw InputError(directory + ": no such folder");
  return Reading(directory, options).run();
}

Role Dataset::role(size_t frame, size_t camera) const {
  const FrameSplit split = frames_.at(frame).split;
  if (cameras_.at(camera).held_out)
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

std::string Dataset::image_path(size_t frame, size_t camera) const {
  return (fs::path(directory_) / "images_lr" / cameras_.at(camera).name /
          image_files_.at(camera).at(frame))
      .string();
}

std::string Dataset::mask_path(size_t frame, size_t camera) const {
  return (fs::path(directory_) / "fmask_lr" / cameras_.at(camera).name /
          mask_files_.at(camera).at(frame))
      .string();
}

CaptureImage Dataset::load_image(size_t frame, size_t camera) const {
  const Camera& expected = cameras_.at(camera).camera;
  const auto check_size = [&](const std::string& path, const ports::ImageU8& image) {
    if (image.width_px == expected.width_px && image.height_px == expected.height_px) return;
    throw InputError(path + ": is " + std::to_string(image.width_px) + "x" +
                     std::to_string(image.height_px) + ", the camera's images are " +
                     std::to_string(expected.width_px) + "x" + std::to_string(expected.height_px));
  };
  const std::string colour_path = image_path(frame, camera);
  Result<ports::ImageU8> colour = ports::decode_jpeg(map_file(colour_path).bytes(), colour_path);
  if (!colour.ok()) throw InputError(colour.status().message());
  check_size(colour_path, *colour);

  const std::string alpha_path = mask_path(frame, camera);
  const ports::MappedFile mask_file = map_file(alpha_path);
  Result<ports::ImageU8> decoded = ports::decode_png(mask_file.bytes(), alpha_path);
  if (!decoded.ok()) throw InputError(decoded.status().message());
  const ports::ImageU8& mask = *decoded;
  check_size(alpha_path, mask);

  CaptureImage image{expected.width_px, expected.height_px, std::move(colour->pixels), {}};
  const size_t count = size_t{image.width_px} * image.height_px;
  image.alpha.resize(count);
  for (size_t i = 0; i < count; ++i)
    image.alpha[i] = mask.pixels[i * mask.channels];  // grey, or any channel of a grey RGB mask
  if (!composited_on_black_) {
    for (size_t i = 0; i < count; ++i) {
      for (int c = 0; c < 3; ++c)
        image.rgb[i * 3 + c] =
            static_cast<uint8_t>((image.rgb[i * 3 + c] * image.alpha[i] + 127) / 255);
    }
  }
  return image;
}

}  // namespace figurine::dataset
