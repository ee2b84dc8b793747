// EasyMocap's layout: what people with cameras of their own have (docs/own_person.md). Cameras are
// OpenCV's, whose pixel centres are whole numbers: half a pixel is added to principal points.
#include <cmath>
#include <set>

#include "toolchain/dataset/layouts.h"
#include "toolchain/dataset/opencv_yaml.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kEasymocapImages{"images"};
const std::vector<std::string> kEasymocapMasks{"mask", "masks", "mask-schp", "mask_cihp", "fmask"};
const std::vector<std::string> kEasymocapPoses{"output/smplx/smplx",
                                               "output/smplx/smpl",
                                               "output/smplx",
                                               "output/smpl/smpl",
                                               "output/smpl",
                                               "output-smpl-3d/smplfull",
                                               "output-smpl-3d/smpl",
                                               "output-smplx-3d/smplfull",
                                               "smplx/smpl",
                                               "smplx",
                                               "smpl"};

std::array<double, 9> rotation_of_vector(const std::vector<double>& v) {
  const double angle = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const double s = angle < 1e-12 ? 1 : std::sin(angle) / angle,
               k = angle < 1e-12 ? 0.5 : (1 - std::cos(angle)) / (angle * angle);
  const double c = std::cos(angle);
  return {c + k * v[0] * v[0],        k * v[0] * v[1] - s * v[2], k * v[0] * v[2] + s * v[1],
          k * v[1] * v[0] + s * v[2], c + k * v[1] * v[1],        k * v[1] * v[2] - s * v[0],
          k * v[2] * v[0] - s * v[1], k * v[2] * v[1] + s * v[0], c + k * v[2] * v[2]};
}

class EasymocapReading {
 public:
  EasymocapReading(const std::string& directory, const DatasetOptions& options)
      : root_(directory), options_(options) {
    parts_.directory = directory;
  }

  DatasetParts run() {
    if (options_.body == nullptr) {
      throw InputError(parts_.directory + ": its poses need a body (the pelvis' rest position)");
    }
    if (options_.body->joint_count() != kSmplxJoints) {
      throw InputError(parts_.directory + ": needs a body of 55 joints, the given one has " +
                       std::to_string(options_.body->joint_count()));
    }
    read_cameras();
    read_frames();
    match_files(files_, parts_);
    leave_out_blind_cameras(options_, (root_ / "extri.yml").string(), parts_);
    split_by_rule(parts_);
    return std::move(parts_);
  }

 private:
  void read_cameras() {
    const std::string intri_path = (root_ / "intri.yml").string(),
                      extri_path = (root_ / "extri.yml").string();
    const OpencvYaml intri = OpencvYaml::read(intri_path), extri = OpencvYaml::read(extri_path);
    const std::string images = existing_folder(root_, kEasymocapImages, "images"),
                      masks = existing_folder(root_, kEasymocapMasks, "masks");
    std::set<std::string> seen;
    for (const std::string& name : intri.texts("names")) {
      if (name.empty() || name.find('/') != std::string::npos || name == "..")
        throw InputError(intri_path + ": names: '" + name + "' is no folder's name");
      if (!seen.insert(name).second)
        throw InputError(intri_path + ": names: '" + name + "' stands twice");
      CameraFiles files{numbered_pictures((root_ / images / name).string()),
                        numbered_pictures((root_ / masks / name).string())};
      if (files.images.empty()) {
        ++parts_.cameras_left_out;
        parts_.remarks.push_back("camera " + name + " has no images, left out");
        continue;
      }
      const PictureSize size = read_picture_size(files.images.begin()->second);
      CaptureCamera camera{.name = name, .camera = read_camera(intri, extri, name, size)};
      camera.camera.width_px = size.width_px, camera.camera.height_px = size.height_px;
      check(camera, intri, intri_path, extri_path);
      parts_.cameras.push_back(std::move(camera));
      files_.push_back(std::move(files));
    }
    if (parts_.cameras.empty()) throw InputError(parts_.directory + ": no usable camera");
  }

  static Camera read_camera(const OpencvYaml& intri, const OpencvYaml& extri,
                            const std::string& name, const PictureSize& size) {
    const std::vector<double> k = intri.numbers("K_" + name, 9);
    const std::string rotation_key = extri.has("Rot_" + name) ? "Rot_" + name : "R_" + name;
    std::vector<double> rotation = extri.numbers(rotation_key);
    if (rotation.size() == 3) {
      const std::array<double, 9> matrix = rotation_of_vector(rotation);
      rotation.assign(matrix.begin(), matrix.end());
    } else {
      rotation = extri.numbers(rotation_key, 9);
    }
    const std::vector<double> translation = extri.numbers("T_" + name, 3);
    Camera camera{.width_px = size.width_px,
                  .height_px = size.height_px,
                  .fx_px = static_cast<float>(k[0]),
                  .fy_px = static_cast<float>(k[4]),
                  .cx_px = static_cast<float>(k[2] + 0.5),
                  .cy_px = static_cast<float>(k[5] + 0.5)};
    for (size_t row = 0; row < 3; ++row) {
      for (size_t column = 0; column < 3; ++column)
        camera.view_from_world[row * 4 + column] = static_cast<float>(rotation[row * 3 + column]);
      camera.view_from_world[row * 4 + 3] = static_cast<float>(translation[row]);
    }
    return camera;
  }

  void check(CaptureCamera& capture, const OpencvYaml& intri, const std::string& intri_path,
             const std::string& extri_path) {
    const std::string& name = capture.name;
    const Camera& camera = capture.camera;
    const std::string key = intri_path + ": K_" + name;
    check_intrinsics(intri.numbers("K_" + name, 9), key);
    throw_if_error(validate_camera(camera), extri_path + ": camera " + name);
    const auto in_middle = [](float centre, uint32_t side) {
      return centre > 0.25f * static_cast<float>(side) && centre < 0.75f * static_cast<float>(side);
    };
    if (!in_middle(camera.cx_px, camera.width_px) || !in_middle(camera.cy_px, camera.height_px)) {
      throw InputError(key + ": principal point is not near the middle of the images of " +
                       std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px) +
                       "; are they of the size that was calibrated?");
    }
    for (const char* prefix : {"dist_", "D_"}) {
      if (!intri.has(prefix + name)) continue;
      const std::string where = intri_path + ": " + prefix + name;
      capture.lens = make_lens(intri.numbers(prefix + name), where);
      if (capture.lens.bends() && !is_one_to_one(camera, capture.lens))
        throw InputError(where + ": folds the image over itself; of another lens or size?");
      bends_ = bends_ || capture.lens.bends();
    }
  }

  void read_frames() {
    std::string folder;
    NumberedFiles files;
    for (const std::string& name : kEasymocapPoses) {
      folder = (root_ / name).string();
      std::error_code error;
      for (fs::directory_iterator it(folder, error), end; !error && it != end;
           it.increment(error)) {
        const std::string file = it->path().filename().string();
        const std::optional<uint32_t> number = leading_number(file);
        if (number && file.ends_with(".json")) files[*number] = it->path().string();
      }
      if (!files.empty()) break;
    }
    if (files.empty()) {
      throw InputError(parts_.directory + ": no poses: NUMBER.json files in one of " +
                       kEasymocapPoses.front() + " ... " + kEasymocapPoses.back() +
                       " (docs/own_person.md)");
    }
    std::map<uint32_t, std::vector<SmplxPerson>> people;
    std::set<uint32_t> numbers;
    for (const CameraFiles& camera : files_) {
      for (const auto& [number, path] : camera.images) numbers.insert(number);
    }
    for (const auto& [number, path] : files) {
      if (numbers.contains(number)) people[number] = read_smplx_people(path);
    }
    const std::map<uint32_t, SmplxPerson> chosen = choose_person(people, folder);
    for (const uint32_t number : numbers) {
      const auto found = chosen.find(number);
      if (found == chosen.end()) {
        ++parts_.frames_without_pose;
        continue;
      }
      add_frame(number, found->second, files.at(number));
    }
    if (parts_.frames.empty())
      throw InputError(parts_.directory + ": no frame has both image and pose");
    if (parts_.frames_without_pose > 0)
      parts_.remarks.push_back(counted(parts_.frames_without_pose, "frame") +
                               " without a pose, left out");
    if (bends_) parts_.remarks.push_back("images are straightened by the cameras' distortion");
  }

  void add_frame(uint32_t number, const SmplxPerson& person, const std::string& path) {
    if (parts_.frames.empty()) {
      // SMPL's shapes are coefficients of other directions than the body's.
      if (person.smpl && options_.origin.smplx) {
        parts_.remarks.push_back("poses are SMPL's: their shapes are not SMPL-X's and stay unused");
      } else {
        take_shape(person.shapes, options_, path + ": shapes", parts_);
      }
    }
    CaptureFrame frame{.number = number, .rotations = {}};
    set_pose(person, root_rest_position(*options_.body, parts_.shape), options_.origin, frame);
    parts_.frames.push_back(std::move(frame));
  }

  const fs::path root_;
  const DatasetOptions& options_;
  std::vector<CameraFiles> files_;  // [V]
  bool bends_ = false;
  DatasetParts parts_;
};

}  // namespace

DatasetParts read_easymocap(const std::string& directory, const DatasetOptions& options) {
  return EasymocapReading(directory, options).run();
}

}  // namespace figurine::dataset
