// MVHumanNet's layout, real or of figurine-train capture.
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "toolchain/dataset/json_fields.h"
#include "toolchain/dataset/layouts.h"
#include "toolchain/dataset/pickle.h"
#include "toolchain/dataset/read_file.h"
#include "toolchain/dataset/skeleton_hash.h"
#include "toolchain/error.h"

namespace figurine::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr uint32_t kWrongCamera = 41;  // MVHumanNet's own calibration of it is off
const std::vector<std::string> kMvHumanNetImages{"images_lr", "images"};
const std::vector<std::string> kMvHumanNetMasks{"fmask_lr", "fmask"};

FrameSplit parse_split(const JsonField& field) {
  const std::string text = field.text();
  if (text == "train") return FrameSplit::kTrain;
  if (text == "interleaved") return FrameSplit::kInterleaved;
  if (text == "block") return FrameSplit::kBlock;
  field.fail("unknown split '" + text + "'");
}

// The steps of open(), in their order. Each fills a part of the set or throws; what one step learns
// that a later one needs, and the set does not, lives here.
class MvHumanNetReading {
 public:
  MvHumanNetReading(const std::string& directory, const DatasetOptions& options)
      : root_(directory),
        options_(options),
        own_path_((root_ / "figurine.json").string()),
        own_(fs::exists(own_path_)),
        own_json_(own_ ? read_json_file(own_path_) : json::object()),
        about_(own_json_, own_path_ + ": ") {
    set_.directory = directory;
  }

  DatasetParts run() {
    if (own_) read_own_description();
    check_body();
    read_cameras();
    read_frames();
    match_files(files_, set_);
    if (own_) take_marked_cameras();
    leave_out_blind_cameras(options_, (root_ / "camera_extrinsics.json").string(), set_);
    if (!own_) split_by_rule(set_);
    return std::move(set_);
  }

 private:
  // Number, then the camera's key and folder.
  using CameraNames = std::map<uint32_t, std::pair<std::string, std::string>>;

  // figurine.json carries what the layout cannot.
  void read_own_description() {
    if (about_["version"].whole() != 1)
      about_["version"].fail("unknown version; this build reads 1");
    if (!about_["complete"].boolean())
      throw InputError(own_path_ +
                       ": complete: the capture was interrupted; finish it with --resume");
    set_.seed = about_["seed"].whole();
    set_.body_name = about_["body"]["name"].text();
    set_.body_hash = about_["body"]["hash"].text();
    for (double s : about_["shape"].numbers()) set_.shape.push_back(static_cast<float>(s));
    for (const JsonField& source : about_["sources"].items()) set_.sources.push_back(source.text());
    const std::string background = about_["background"].text();
    if (background != "black") about_["background"].fail("unknown background '" + background + "'");
    set_.composited_on_black = true;
    if (options_.body == nullptr) return;
    const std::string where = about_["shape"].where();
    if (set_.shape.size() != options_.body->shape_count()) {
      throw InputError(where + ": has " + std::to_string(set_.shape.size()) +
                       " numbers, the body has " + std::to_string(options_.body->shape_count()));
    }
    check_shape(*options_.body, set_.shape, where);
  }

  void check_body() const {
    if (own_ && !options_.body_hash.empty() && options_.body_hash != set_.body_hash &&
        !has_skeleton_of_body()) {
      about_["body"]["hash"].fail("captured with body " + set_.body_hash +
                                  ", but the given body is " + options_.body_hash);
    }
    if (!own_ && options_.body == nullptr) {
      throw InputError(
          set_.directory +
          ": has no figurine.json, so its poses need a body (the pelvis' rest position)");
    }
    if (options_.body != nullptr && options_.body->joint_count() != kSmplxJoints) {
      throw InputError(set_.directory + ": needs a body of 55 joints, the given one has " +
                       std::to_string(options_.body->joint_count()));
    }
  }

  // Captures of before the field stand for their own body alone.
  bool has_skeleton_of_body() const {
    return options_.body != nullptr && about_["body"].has("skeleton") &&
           about_["body"]["skeleton"].text() == skeleton_hash(*options_.body);
  }

  void read_cameras() {
    const std::string intrinsics_path = (root_ / "camera_intrinsics.json").string(),
                      extrinsics_path = (root_ / "camera_extrinsics.json").string(),
                      scale_path = (root_ / "camera_scale.pkl").string();
    const json intrinsics_json = read_json_file(intrinsics_path),
               extrinsics_json = read_json_file(extrinsics_path);
    const JsonField intrinsics(intrinsics_json, intrinsics_path + ": "),
        extrinsics(extrinsics_json, extrinsics_path + ": ");
    const double scale = read_pickled_number(map_file(scale_path).bytes(), scale_path);
    if (!(scale > 0)) throw InputError(scale_path + ": camera scale must be positive");
    images_folder_ = existing_folder(root_, kMvHumanNetImages, "images");
    const std::string masks_folder = existing_folder(root_, kMvHumanNetMasks, "masks");
    std::string without;
    for (const auto& [number, key_and_name] : camera_names(extrinsics_json, extrinsics_path)) {
      const auto& [key, name] = key_and_name;
      if (number == kWrongCamera) {
        ++set_.cameras_left_out;
        continue;
      }
      CameraFiles files{numbered_pictures((root_ / images_folder_ / name).string()),
                        numbered_pictures((root_ / masks_folder / name).string())};
      if (files.images.empty()) {
        if (own_) throw InputError((root_ / images_folder_ / name).string() + ": no images");
        ++set_.cameras_left_out;
        without += (without.empty() ? "" : ", ") + name;
        continue;
      }
      set_.cameras.push_back(read_camera(name, extrinsics[key], intrinsics, scale,
                                         read_picture_size(files.images.begin()->second)));
      files_.push_back(std::move(files));
    }
    if (set_.cameras.empty()) throw InputError(set_.directory + ": no usable camera");
    if (!without.empty()) set_.remarks.push_back("cameras without images, left out: " + without);
  }

  // intrinsics: of all cameras that have none of their own.
  CaptureCamera read_camera(const std::string& name, const JsonField& extrinsics,
                            const JsonField& intrinsics, double scale, const PictureSize& size) {
    CaptureCamera capture{.name = name, .camera = {}};
    Camera& camera = capture.camera;
    camera.width_px = size.width_px;
    camera.height_px = size.height_px;
    const std::vector<double> shared = intrinsics["intrinsics"].numbers(9);
    check_intrinsics(shared, intrinsics["intrinsics"].where());
    double fx = shared[0], fy = shared[4], cx = shared[2], cy = shared[5];
    std::string centre_field = intrinsics["intrinsics"].where();
    if (extrinsics.has("focal_length")) {
      const std::vector<double> own = extrinsics["focal_length"].numbers();
      if (own.empty() || own.size() > 2)
        extrinsics["focal_length"].fail("is not one or two numbers");
      fx = own.front(), fy = own.back();
    }
    if (extrinsics.has("image_center")) {
      const std::vector<double> own = extrinsics["image_center"].numbers(2);
      cx = own[0], cy = own[1];
      centre_field = extrinsics["image_center"].where();
    }
    const double zoom = image_scale(cx, cy, size, centre_field);
    camera.fx_px = static_cast<float>(fx * zoom), camera.fy_px = static_cast<float>(fy * zoom);
    camera.cx_px = static_cast<float>(cx * zoom), camera.cy_px = static_cast<float>(cy * zoom);
    const std::vector<double> rotation = extrinsics["rotation"].numbers(9);
    const std::vector<double> translation = extrinsics["translation"].numbers(3);
    for (size_t row = 0; row < 3; ++row) {
      for (size_t column = 0; column < 3; ++column)
        camera.view_from_world[row * 4 + column] = static_cast<float>(rotation[row * 3 + column]);
      camera.view_from_world[row * 4 + 3] = static_cast<float>(translation[row] * scale);
    }
    throw_if_error(validate_camera(camera), extrinsics.where());
    const JsonField& of_lens = extrinsics.has("dist") ? extrinsics : intrinsics;
    if (of_lens.has("dist") && !of_lens["dist"].json().is_null()) {
      const JsonField dist = of_lens["dist"];
      capture.lens = make_lens(dist.numbers(), dist.where());
      if (capture.lens.bends() && !is_one_to_one(camera, capture.lens))
        dist.fail("folds the image over itself; of another lens or size?");
      if (capture.lens.bends() && !bends_) {
        bends_ = true;
        set_.remarks.push_back("images are straightened by the cameras' distortion");
      }
    }
    return capture;
  }

  // The intrinsics speak of images of twice the size, those of the recording; of images that were
  // not made smaller they speak as they are. Which it is shows where the principal point falls.
  double image_scale(double cx, double cy, const PictureSize& size, const std::string& where) {
    const auto from_middle = [&](double zoom) {
      return std::max(std::abs(cx * zoom / size.width_px - 0.5),
                      std::abs(cy * zoom / size.height_px - 0.5));
    };
    const double half = from_middle(0.5), whole = from_middle(1);
    if (own_ || half <= whole) {
      if (half < 0.5) return 0.5;
    } else if (whole < 0.2) {
      if (!whole_) set_.remarks.push_back("images are of the size of the intrinsics, not of half");
      whole_ = true;
      return 1;
    }
    throw InputError(where + ": principal point is nowhere near the middle of the images of " +
                     std::to_string(size.width_px) + "x" + std::to_string(size.height_px) +
                     ", which should be of half its size or of its own");
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

  // Frames are the numbers of all cameras' images that have a pose.
  void read_frames() {
    std::set<uint32_t> numbers;
    for (const CameraFiles& camera : files_) {
      for (const auto& [number, path] : camera.images) numbers.insert(number);
    }
    if (own_) {
      read_own_frames(numbers);
    } else {
      read_smplx_frames(numbers);
    }
    set_.frames_without_pose = static_cast<uint32_t>(numbers.size() - set_.frames.size());
    if (set_.frames.empty())
      throw InputError(set_.directory + ": no frame has both image and pose");
    if (!own_ && set_.frames_without_pose > 0)
      set_.remarks.push_back(counted(set_.frames_without_pose, "frame") +
                             " without a pose, left out");
  }

  void read_own_frames(const std::set<uint32_t>& numbers) {
    const std::map<uint32_t, JsonField> own_frames = list_own_frames();
    for (const uint32_t number : numbers) {
      CaptureFrame frame{.number = number, .rotations = {}};
      if (read_own_pose(own_frames, frame)) set_.frames.push_back(std::move(frame));
    }
    if (set_.frames.size() != own_frames.size()) {
      throw InputError(own_path_ + ": frames: names " + std::to_string(own_frames.size()) +
                       ", but only " + std::to_string(set_.frames.size()) + " have images");
    }
  }

  // The person's shape is the first frame's.
  void read_smplx_frames(const std::set<uint32_t>& numbers) {
    const fs::path folder = root_ / "smplx" / "smpl";
    std::map<uint32_t, std::vector<SmplxPerson>> people;
    std::string first;
    for (const uint32_t number : numbers) {
      const uint32_t index = number / kFrameStep;
      if (number % kFrameStep != 0 || index == 0) continue;
      const std::string digits = std::to_string(index - 1);
      const std::string path =
          (folder / (std::string(6 - std::min<size_t>(6, digits.size()), '0') + digits + ".json"))
              .string();
      if (!fs::exists(path)) continue;
      people[number] = read_smplx_people(path);
      if (first.empty()) first = path;
    }
    for (const auto& [number, person] : choose_person(people, folder.string())) {
      if (set_.frames.empty()) take_shape(person.shapes, options_, first + ": shapes", set_);
      CaptureFrame frame{.number = number, .rotations = {}};
      set_pose(person, root_rest_position(*options_.body, set_.shape), options_.origin, frame);
      set_.frames.push_back(std::move(frame));
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
          std::find_if(set_.cameras.begin(), set_.cameras.end(),
                       [&](const CaptureCamera& camera) { return camera.name == wanted; });
      if (found == set_.cameras.end()) about_[field].fail("no camera is called '" + wanted + "'");
      mark(*found);
    }
  }

  const fs::path root_;
  const DatasetOptions& options_;
  const std::string own_path_;
  const bool own_;  // made by figurine-train capture
  const json own_json_;
  const JsonField about_;
  std::string images_folder_;
  std::vector<CameraFiles> files_;  // [V]
  bool bends_ = false, whole_ = false;
  DatasetParts set_;
};

}  // namespace

DatasetParts read_mvhumannet(const std::string& directory, const DatasetOptions& options) {
  return MvHumanNetReading(directory, options).run();
}

}  // namespace figurine::dataset
