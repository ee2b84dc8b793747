#include "toolchain/dataset/dataset.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "ports/host/files.h"
#include "ports/media/png.h"
#include "toolchain/dataset/jpeg.h"
#include "toolchain/dataset/json_fields.h"
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
                   ImageSize size) {
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

Dataset Dataset::open(const std::string& directory, const DatasetOptions& options) {
  Dataset set;
  set.directory_ = directory;
  const fs::path root(directory);
  if (!fs::is_directory(root)) throw InputError(directory + ": no such folder");

  // Ours carries what the layout cannot.
  const std::string own_path = (root / "figurine.json").string();
  const bool own = fs::exists(own_path);
  const json own_json = own ? read_json(own_path) : json::object();
  const JsonField about(own_json, own_path + ": ");
  if (own) {
    if (about["version"].whole() != 1) about["version"].fail("unknown version; this build reads 1");
    if (!about["complete"].boolean())
      throw InputError(own_path +
                       ": complete: the capture was interrupted; finish it with --resume");
    set.seed_ = about["seed"].whole();
    set.body_name_ = about["body"]["name"].text();
    set.body_hash_ = about["body"]["hash"].text();
    for (double s : about["shape"].numbers()) set.shape_.push_back(static_cast<float>(s));
    for (const JsonField& source : about["sources"].items()) set.sources_.push_back(source.text());
    const std::string background = about["background"].text();
    if (background != "black") about["background"].fail("unknown background '" + background + "'");
    set.composited_on_black_ = true;
    if (!options.body_hash.empty() && options.body_hash != set.body_hash_) {
      about["body"]["hash"].fail("captured with body " + set.body_hash_ +
                                 ", but the given body is " + options.body_hash);
    }
  } else if (options.body == nullptr) {
    throw InputError(
        directory + ": has no figurine.json, so its poses need a body (the pelvis' rest position)");
  }
  if (options.body != nullptr && options.body->joint_count() != kSmplxJoints) {
    throw InputError(directory + ": needs a body of 55 joints, the given one has " +
                     std::to_string(options.body->joint_count()));
  }

  // Cameras. The key is "NUMBER_NAME.png".
  const std::string intrinsics_path = (root / "camera_intrinsics.json").string();
  const json intrinsics_json = read_json(intrinsics_path);
  const std::vector<double> intrinsics =
      JsonField(intrinsics_json, intrinsics_path + ": ")["intrinsics"].numbers(9);
  const double scale = read_pickled_float((root / "camera_scale.pkl").string());
  const std::string extrinsics_path = (root / "camera_extrinsics.json").string();
  const json extrinsics_json = read_json(extrinsics_path);
  if (!extrinsics_json.is_object())
    throw InputError(extrinsics_path + ": not an object of cameras");
  std::map<uint32_t, std::pair<std::string, std::string>> ordered;  // number -> key, name
  for (const auto& [key, value] : extrinsics_json.items()) {
    const std::optional<uint32_t> number = leading_number(key);
    const size_t underscore = key.find('_');
    if (!number || underscore == std::string::npos || underscore + 1 == key.size()) {
      throw InputError(extrinsics_path + ": " + key + ": a camera is called NUMBER_NAME.png");
    }
    std::string name = key.substr(underscore + 1);
    if (name.ends_with(".png")) name.resize(name.size() - 4);
    if (name.find('/') != std::string::npos || name == "..")
      throw InputError(extrinsics_path + ": " + key + ": not a folder's name");
    if (!ordered.emplace(*number, std::pair(key, name)).second)
      throw InputError(extrinsics_path + ": two cameras of number " + std::to_string(*number));
  }
  std::vector<std::map<uint32_t, std::string>> images, masks;
  std::vector<uint32_t> camera_numbers;
  for (const auto& [number, key_and_name] : ordered) {
    const auto& [key, name] = key_and_name;
    const fs::path image_folder = root / "images_lr" / name;
    if (number == kWrongCamera || (!own && !fs::is_directory(image_folder))) {
      ++set.cameras_left_out_;
      continue;
    }
    images.push_back(numbered_files(image_folder.string(), ".jpg"));
    masks.push_back(numbered_files((root / "fmask_lr" / name).string(), ".png"));
    if (images.back().empty()) throw InputError(image_folder.string() + ": no images");
    const std::string first = (image_folder / images.back().begin()->second).string();
    const ImageSize size = decode_jpeg_size(map_file(first).bytes(), first);
    CaptureCamera camera;
    camera.name = name;
    camera.camera = read_camera(JsonField(extrinsics_json, extrinsics_path + ": ")[key], intrinsics,
                                scale, size);
    // The images are half the size that the intrinsics speak of: a principal point outside the
    // image shows data of another size.
    if (!(camera.camera.cx_px > 0 && camera.camera.cx_px < size.width_px &&
          camera.camera.cy_px > 0 && camera.camera.cy_px < size.height_px)) {
      throw InputError(
          intrinsics_path + ": intrinsics: principal point, halved, is outside the images of " +
          name + " (" + std::to_string(size.width_px) + "x" + std::to_string(size.height_px) + ")");
    }
    set.cameras_.push_back(std::move(camera));
    camera_numbers.push_back(number);
  }
  if (set.cameras_.empty()) throw InputError(directory + ": no usable camera");

  // Frames: the images' numbers that have a pose.
  std::map<uint32_t, JsonField> own_frames;
  if (own) {
    for (const JsonField& frame : about["frames"].items()) {
      const uint64_t number = frame["number"].whole();
      if (number == 0 || number > 999'999'999) frame["number"].fail("out of range");
      if (!own_frames.emplace(static_cast<uint32_t>(number), frame).second)
        frame["number"].fail("stands twice");
    }
  }
  for (const auto& [number, file] : images[0]) {
    CaptureFrame frame;
    frame.number = number;
    const auto found = own_frames.find(number);
    if (found != own_frames.end()) {
      const JsonField& field = found->second;
      frame.split = parse_split(field["split"]);
      const std::vector<double> translation = field["root_translation_m"].numbers(3);
      for (int i = 0; i < 3; ++i) frame.root_translation_m[i] = static_cast<float>(translation[i]);
      for (double q : field["rotations"].numbers(kSmplxJoints * 4))
        frame.rotations.push_back(static_cast<float>(q));
      throw_if_error(validate_pose(frame.pose(), kSmplxJoints), field["rotations"].where());
    } else if (own) {
      ++set.frames_without_pose_;
      continue;
    } else {
      const uint32_t index = number / kFrameStep;
      const std::string path =
          (root / "smplx" / "smpl" /
           (std::string(6 - std::min<size_t>(6, std::to_string(index - 1).size()), '0') +
            std::to_string(index - 1) + ".json"))
              .string();
      if (number % kFrameStep != 0 || index == 0 || !fs::exists(path)) {
        ++set.frames_without_pose_;
        continue;
      }
      const SmplxPose smplx = read_smplx(path);
      if (set.shape_.empty())
        set.shape_ = smplx.shapes;  // one person: the first frame's shape is everyone's
      set_pose(smplx, root_rest_position(*options.body, set.shape_), frame);
    }
    set.frames_.push_back(std::move(frame));
  }
  if (set.frames_.empty()) throw InputError(directory + ": no frame has both image and pose");
  if (own && set.frames_.size() != own_frames.size()) {
    throw InputError(own_path + ": frames: names " + std::to_string(own_frames.size()) +
                     ", but only " + std::to_string(set.frames_.size()) + " have images");
  }

  for (size_t c = 0; c < set.cameras_.size(); ++c) {
    set.image_files_.emplace_back();
    set.mask_files_.emplace_back();
    for (const CaptureFrame& frame : set.frames_) {
      const auto missing = [&](const char* folder) {
        throw InputError((root / folder / set.cameras_[c].name).string() + ": frame " +
                         frame_label(frame.number) + ": missing");
      };
      const auto image = images[c].find(frame.number);
      const auto mask = masks[c].find(frame.number);
      if (image == images[c].end()) missing("images_lr");
      if (mask == masks[c].end()) missing("fmask_lr");
      set.image_files_.back().push_back(image->second);
      set.mask_files_.back().push_back(mask->second);
    }
  }

  // Splits: as marked, or by rule.
  if (own) {
    std::set<std::string> held_out;
    for (const JsonField& name : about["held_out_cameras"].items()) held_out.insert(name.text());
    for (CaptureCamera& camera : set.cameras_) camera.held_out = held_out.erase(camera.name) != 0;
    if (!held_out.empty())
      about["held_out_cameras"].fail("no camera is called '" + *held_out.begin() + "'");
  } else {
    const Split split = default_split(static_cast<uint32_t>(set.frames_.size()),
                                      static_cast<uint32_t>(set.cameras_.size()));
    for (size_t f = 0; f < set.frames_.size(); ++f) set.frames_[f].split = split.frames[f];
    for (size_t c = 0; c < set.cameras_.size(); ++c)
      set.cameras_[c].held_out = split.held_out_camera[c];
  }
  return set;
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
  ports::ImageU8 colour = decode_jpeg(map_file(colour_path).bytes(), colour_path);
  check_size(colour_path, colour);

  const std::string alpha_path = mask_path(frame, camera);
  const ports::MappedFile mask_file = map_file(alpha_path);
  Result<ports::ImageU8> decoded = ports::decode_png(mask_file.bytes(), alpha_path);
  if (!decoded.ok()) throw InputError(decoded.status().message());
  const ports::ImageU8& mask = *decoded;
  check_size(alpha_path, mask);

  CaptureImage image{expected.width_px, expected.height_px, std::move(colour.pixels), {}};
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
