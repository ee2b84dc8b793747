#include "toolchain/capture/layout.h"

#include <fcntl.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "ports/host/atomic_file.h"
#include "ports/host/files.h"
#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/error.h"

namespace figurine::capture {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr int kJpegQuality = 97;
constexpr double kCameraScale = 0.001;  // stored translations are millimetres; readers multiply

// The shortest decimal that reads back as the same float.
double decimal(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", static_cast<double>(value));
  return std::strtod(text, nullptr);
}

template <class Range>
ordered_json decimals(const Range& values) {
  ordered_json list = ordered_json::array();
  for (float v : values) list.push_back(decimal(v));
  return list;
}

void write_bytes(const std::string& path, std::span<const std::byte> bytes) {
  throw_if_error(ports::write_file_atomically(path, bytes), "-o");
}

// Whole or not at all, but not synced one by one: thousands of images would spend their time
// waiting for the disk. finish() syncs them together, before figurine.json calls the capture
// complete.
void write_unsynced(const std::string& path, std::span<const std::byte> bytes) {
  ports::AtomicFile file = value_or_throw(ports::AtomicFile::create(path), "-o");
  throw_if_error(file.write(bytes), "-o");
  throw_if_error(file.commit_unsynced(), "-o");
}

void sync_file_system_of(const std::string& directory) {
  const int folder = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = folder >= 0 && ::syncfs(folder) == 0;
  const std::string reason = std::strerror(errno);
  if (folder >= 0) ::close(folder);
  if (!synced) throw InputError(directory + ": " + reason);
}

// A file that is there and not empty: what a crash may leave of an image that was not synced is
// empty.
bool has_content(const std::string& path) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  return !error && size > 0;
}

// Axis times angle, the angle in [0, pi].
std::array<double, 3> rotation_vector(const float* wxyz) {
  const double sign = wxyz[0] < 0 ? -1 : 1;
  const double x = sign * wxyz[1], y = sign * wxyz[2], z = sign * wxyz[3],
               length = std::sqrt(x * x + y * y + z * z);
  if (length < 1e-12) return {0, 0, 0};
  const double scale = 2 * std::atan2(length, sign * wxyz[0]) / length;
  return {scale * x, scale * y, scale * z};
}

// The smplx file of one frame, as MVHumanNet's fits have it: Rh and Th about the origin, 87 numbers
// of pose, ten of shape. Hands are lost here (their 6 + 6 numbers are zero): figurine.json holds
// them.
ordered_json smplx_person(const CapturedPose& captured, const std::vector<float>& shape,
                          const std::array<float, 3>& root_rest_m) {
  const std::vector<float>& rotations = captured.pose.rotations;
  const auto add = [&](ordered_json& list, int joint) {
    for (double v : rotation_vector(&rotations[size_t(joint) * 4])) list.push_back(v);
  };
  ordered_json rh = ordered_json::array(), th = ordered_json::array(),
               poses = ordered_json::array({0.0, 0.0, 0.0});
  add(rh, 0);
  // Our root turns about its joint r: x -> R (x - r) + r + t. About the origin that is R x + Th
  // with Th = r + t - R r.
  const std::array<float, 9> turn = rotation_from_quaternion(rotations.data());
  for (int i = 0; i < 3; ++i) {
    double turned = 0;
    for (int k = 0; k < 3; ++k) turned += double{turn[i * 3 + k]} * root_rest_m[k];
    th.push_back(double{root_rest_m[i]} + captured.pose.root_translation_m[i] - turned);
  }
  for (int joint = 1; joint < 22; ++joint) add(poses, joint);
  for (int i = 0; i < 12; ++i) poses.push_back(0.0);
  for (int joint = 22; joint < 25; ++joint) add(poses, joint);
  ordered_json shapes = ordered_json::array(), expression = ordered_json::array();
  for (size_t i = 0; i < 10; ++i) {
    shapes.push_back(i < shape.size() ? decimal(shape[i]) : 0.0);
    expression.push_back(0.0);
  }
  return {{"id", 0},
          {"Rh", {rh}},
          {"Th", {th}},
          {"poses", {poses}},
          {"expression", {expression}},
          {"shapes", {shapes}}};
}

std::vector<std::byte> pickled_float(double value) {
  std::vector<std::byte> bytes{std::byte{0x80}, std::byte{3}, std::byte{'G'}};
  const uint64_t bits = std::bit_cast<uint64_t>(value);
  for (int shift = 56; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::byte>(bits >> shift & 0xff));
  bytes.push_back(std::byte{'.'});
  return bytes;
}

const char* to_string(dataset::FrameSplit split) {
  switch (split) {
    case dataset::FrameSplit::kTrain:
      return "train";
    case dataset::FrameSplit::kInterleaved:
      return "interleaved";
    case dataset::FrameSplit::kBlock:
      return "block";
  }
  return "";
}

uint32_t frame_number(size_t frame) {
  return (static_cast<uint32_t>(frame) + 1) * dataset::kFrameStep;
}

std::string numbered(const char* format, uint32_t number) {
  char text[48];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

}  // namespace

IdentityLayout::IdentityLayout(std::string directory, const IdentityRecord& record,
                               const Person& person, const std::vector<RingCamera>& cameras,
                               const std::vector<CapturedPose>& sequence)
    : directory_(std::move(directory)),
      root_rest_m_(record.root_rest_m),
      cameras_(cameras),
      sequence_(sequence) {
  about_["version"] = 1;
  about_["complete"] = false;
  about_["tool"] = record.tool;
  about_["identity"] = record.identity;
  about_["seed"] = record.seed;
  about_["body"] = {
      {"name", record.body_name}, {"hash", record.body_hash}, {"skeleton", record.skeleton_hash}};
  about_["background"] = "black";
  about_["units"] =
      "metres, y up; rotations are quaternions wxyz relative to the parent, rest frames are "
      "world-aligned";
  about_["image"] = {{"width", cameras[0].camera.width_px},
                     {"height", cameras[0].camera.height_px},
                     {"jpeg_quality", kJpegQuality}};
  about_["shape"] = decimals(person.shape);
  about_["shape_error_m"] = decimal(static_cast<float>(person.shape_error_m));
  ordered_json description = ordered_json::object();
  for (const auto& [key, value] : person.description) description[key] = value;
  about_["person"] = description;
  about_["folds"] = record.folds;
  about_["limits"] = {{"outfits", record.limits.outfits},
                      {"skins", record.limits.skins},
                      {"excluded_outfits", record.limits.excluded_outfits},
                      {"excluded_skins", record.limits.excluded_skins},
                      {"hair", record.limits.hair}};
  about_["sources"] = record.sources;
  describe_cameras();
  about_["joints"] = body::joint_names();
  about_["frames"] = ordered_json::array();
  for (size_t f = 0; f < sequence.size(); ++f) {
    const CapturedPose& captured = sequence[f];
    about_["frames"].push_back({{"number", frame_number(f)},
                                {"split", to_string(captured.split)},
                                {"motion", captured.motion},
                                {"motion_frame", captured.motion_frame},
                                {"heading_rad", decimal(captured.heading_rad)},
                                {"root_translation_m", decimals(captured.pose.root_translation_m)},
                                {"rotations", decimals(captured.pose.rotations)}});
  }
}

// Each framing holds cameras out by itself: bust cameras change nothing for the others.
void IdentityLayout::describe_cameras() {
  about_["held_out_cameras"] = ordered_json::array();
  for (const dataset::Framing framing : {dataset::Framing::kBody, dataset::Framing::kBust}) {
    std::vector<std::string> names;
    for (const RingCamera& camera : cameras_) {
      if (camera.framing == framing) names.push_back(camera.name);
    }
    const dataset::Split split = dataset::default_split(static_cast<uint32_t>(sequence_.size()),
                                                        static_cast<uint32_t>(names.size()));
    for (size_t c = 0; c < names.size(); ++c) {
      if (split.held_out_camera[c]) about_["held_out_cameras"].push_back(names[c]);
    }
    // Nothing is said where there are none, as before there were such cameras.
    if (framing == dataset::Framing::kBust && !names.empty()) about_["bust_cameras"] = names;
  }
}

std::string IdentityLayout::image_path(size_t frame, size_t camera) const {
  return directory_ + "/images_lr/" + cameras_[camera].name + "/" +
         numbered("%04u_img.jpg", frame_number(frame));
}

std::string IdentityLayout::mask_path(size_t frame, size_t camera) const {
  return directory_ + "/fmask_lr/" + cameras_[camera].name + "/" +
         numbered("%04u_img_fmask.png", frame_number(frame));
}

void IdentityLayout::write_json(const std::string& path, const ordered_json& value) const {
  const std::string text = value.dump() + "\n";
  write_bytes(path, std::as_bytes(std::span(text)));
}

void IdentityLayout::begin(bool resume) {
  std::error_code error;
  fs::create_directories(directory_, error);
  if (error) throw InputError(directory_ + ": " + error.message());
  lock_.emplace(value_or_throw(ports::FolderLock::acquire(directory_), "-o"));
  const std::string about_path = directory_ + "/figurine.json";
  if (fs::exists(about_path)) {
    if (!resume)
      throw InputError(directory_ +
                       ": holds a capture already; --resume goes on with it, or choose another -o");
    const ports::MappedFile file = value_or_throw(ports::MappedFile::open(about_path), about_path);
    const auto* text = reinterpret_cast<const char*>(file.bytes().data());
    ordered_json found = ordered_json::parse(text, text + file.bytes().size(), nullptr, false);
    if (!found.is_object()) throw InputError(about_path + ": not valid JSON");
    found["complete"] = false;
    // Compared as text: what was read has become doubles, as what is to be written will.
    if (found.dump() != about_.dump())
      throw InputError(about_path +
                       ": is of a capture with other settings; --resume needs the same command");
  }
  for (const RingCamera& entry : cameras_) {
    for (const char* kind : {"/images_lr/", "/fmask_lr/"}) {
      fs::create_directories(directory_ + kind + entry.name, error);
      if (error) throw InputError(directory_ + kind + entry.name + ": " + error.message());
    }
  }
  fs::create_directories(directory_ + "/smplx/smpl", error);
  if (error) throw InputError(directory_ + "/smplx/smpl: " + error.message());
  if (fs::exists(about_path)) return;

  ordered_json extrinsics = ordered_json::object();
  for (const RingCamera& entry : cameras_) {
    const Camera& camera = entry.camera;
    ordered_json rotation = ordered_json::array(), translation = ordered_json::array();
    for (int row = 0; row < 3; ++row) {
      const float* m = &camera.view_from_world[row * 4];
      rotation.push_back(decimals(std::span(m, 3)));
      translation.push_back(decimal(m[3]) / kCameraScale);
    }
    extrinsics[std::to_string(entry.number) + "_" + entry.name + ".png"] = {
        {"focal_length", 2 * decimal(camera.fx_px)},
        {"image_center", {2 * decimal(camera.cx_px), 2 * decimal(camera.cy_px)}},
        {"rotation", rotation},
        {"translation", translation}};
  }
  write_json(directory_ + "/camera_extrinsics.json", extrinsics);
  // The cameras share their lens: of images of another size than the first one's, intrinsics are in
  // proportion.
  const Camera& one = cameras_[0].camera;
  const double fx = 2 * decimal(one.fx_px), fy = 2 * decimal(one.fy_px),
               cx = 2 * decimal(one.cx_px), cy = 2 * decimal(one.cy_px);
  write_json(directory_ + "/camera_intrinsics.json",
             {{"intrinsics", {{fx, 0.0, cx}, {0.0, fy, cy}, {0.0, 0.0, 1.0}}},
              {"dist", ordered_json::array()}});
  write_bytes(directory_ + "/camera_scale.pkl", pickled_float(kCameraScale));
  std::vector<float> shape;
  for (const ordered_json& s : about_["shape"]) shape.push_back(s.get<float>());
  for (size_t f = 0; f < sequence_.size(); ++f) {
    const std::string text =
        ordered_json::array({smplx_person(sequence_[f], shape, root_rest_m_)}).dump() + "\n";
    write_unsynced(directory_ + "/smplx/smpl/" + numbered("%06u.json", static_cast<uint32_t>(f)),
                   std::as_bytes(std::span(text)));
  }
  write_json(about_path, about_);
}

bool IdentityLayout::has_image(size_t frame, size_t camera) const {
  return has_content(mask_path(frame, camera)) && has_content(image_path(frame, camera));
}

void IdentityLayout::write_image(size_t frame, size_t camera, const Rendering& rendering) const {
  write_unsynced(image_path(frame, camera),
                 value_or_throw(ports::encode_jpeg(rendering.colour, kJpegQuality),
                                image_path(frame, camera)));
  write_unsynced(mask_path(frame, camera),
                 value_or_throw(ports::encode_png(rendering.alpha), mask_path(frame, camera)));
}

void IdentityLayout::finish() const {
  ordered_json about = about_;
  about["complete"] = true;
  sync_file_system_of(directory_);
  write_json(directory_ + "/figurine.json", about);
}

}  // namespace figurine::capture
