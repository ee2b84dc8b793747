#include "samples/common/camera_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

namespace figurine::samples {

namespace {

using Json = nlohmann::json;

constexpr size_t kMaxFileBytes = 64 << 20;
constexpr double kMaxSide_px = 16384;

// The fields of one object, with errors that name file, camera and field. The first one that is
// wrong stays.
class Fields {
 public:
  Fields(const Json& object, std::string where) : object_(object), where_(std::move(where)) {}

  bool has(const char* field) const { return object_.contains(field); }
  const Status& status() const { return status_; }

  void fail(const std::string& what, StatusCode code = StatusCode::kInvalidArgument) {
    if (status_.ok()) status_ = Status(code, where_ + ": " + what);
  }

  // 0 on anything else than a finite number.
  double number(const char* field) {
    if (!has(field)) return missing(field), 0;
    return number_of(object_[field], field);
  }

  // Whole numbers from 1 to 16384; files of NeRFs write them with a point.
  uint32_t side(const char* field) {
    if (!has(field)) return missing(field), 0;
    const double value = object_[field].is_number() ? object_[field].get<double>() : 0;
    if (!(value >= 1 && value <= kMaxSide_px) || value != std::floor(value))
      return fail(std::string(field) + " is not a whole number from 1 to 16384"), 0;
    return static_cast<uint32_t>(value);
  }

  double focal_length(const char* field) {
    const double value = number(field);
    if (!(value > 0)) fail(std::string(field) + " is not a positive focal length");
    return value;
  }

  // [rows, columns] row-major. A row more than those, if the file has it, is that of a matrix that
  // keeps points points: a transposed matrix has its translation there.
  void matrix(const char* field, size_t rows, size_t columns, double* out) {
    if (!has(field)) return missing(field);
    const std::string size = std::to_string(rows) + "x" + std::to_string(columns);
    const Json& json = object_[field];
    const bool square_allowed = columns == rows + 1;
    const bool sized =
        json.is_array() && (json.size() == rows || (square_allowed && json.size() == rows + 1));
    if (!sized) return fail(std::string(field) + not_a_matrix(size, square_allowed));
    for (size_t r = 0; r < json.size(); ++r) {
      if (!json[r].is_array() || json[r].size() != columns)
        return fail(std::string(field) + not_a_matrix(size, square_allowed));
      for (size_t c = 0; c < columns; ++c) {
        const double value = number_of(json[r][c], field);
        if (r < rows) {
          out[r * columns + c] = value;
        } else if (value != (c + 1 == columns ? 1 : 0)) {
          return fail(std::string(field) +
                      ": the fourth row is not [0, 0, 0, 1]; is the matrix transposed?");
        }
      }
    }
  }

  void vector3(const char* field, double* out) {
    if (!has(field)) return missing(field);
    const Json& json = object_[field];
    if (!json.is_array() || json.size() != 3)
      return fail(std::string(field) + " is not a list of three numbers");
    for (size_t k = 0; k < 3; ++k) out[k] = number_of(json[k], field);
  }

 private:
  void missing(const char* field) { fail(std::string("there is no ") + field); }

  static std::string not_a_matrix(const std::string& size, bool square_allowed) {
    return " is not a " + size + (square_allowed ? " or 4x4" : "") + " matrix of numbers";
  }

  double number_of(const Json& json, const char* field) {
    const double value = json.is_number() ? json.get<double>() : NAN;
    if (std::isfinite(value)) return value;
    fail(std::string(field) + (json.is_number() ? " is not finite" : " is not a number"));
    return 0;
  }

  const Json& object_;
  std::string where_;
  Status status_;
};

// The rows of the inverse of [R | centre]: R transposed, and the centre seen from there.
void set_view(const double* rotation, const double* centre, FileCamera& camera) {
  for (size_t r = 0; r < 3; ++r) {
    double translation = 0;
    for (size_t k = 0; k < 3; ++k) {
      camera.view_from_world[4 * r + k] = rotation[3 * k + r];
      translation -= rotation[3 * k + r] * centre[k];
    }
    camera.view_from_world[4 * r + 3] = translation;
  }
}

// validate_camera() allows as much once the pose is in float.
bool is_rotation(const FileCamera& camera) {
  const auto& m = camera.view_from_world;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      double dot = 0;
      for (size_t k = 0; k < 3; ++k) dot += m[4 * i + k] * m[4 * j + k];
      if (!(std::abs(dot - (i == j ? 1 : 0)) <= 1e-3)) return false;
    }
  }
  const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                             m[1] * (m[4] * m[10] - m[6] * m[8]) +
                             m[2] * (m[4] * m[9] - m[5] * m[8]);
  return determinant > 0;
}

// figurine's own.
FileCamera read_own(Fields& fields) {
  FileCamera camera;
  if (fields.has("width")) camera.width_px = fields.side("width");
  if (fields.has("height")) camera.height_px = fields.side("height");
  if (fields.has("width") != fields.has("height")) fields.fail("width and height go together");
  double intrinsics[9] = {};
  fields.matrix("intrinsics", 3, 3, intrinsics);
  if (intrinsics[1] != 0 || intrinsics[3] != 0 || intrinsics[6] != 0 || intrinsics[7] != 0 ||
      intrinsics[8] != 1) {
    fields.fail("intrinsics is not [[fx,0,cx],[0,fy,cy],[0,0,1]] (skew is not supported)");
  }
  camera.fx_px = intrinsics[0];
  camera.fy_px = intrinsics[4];
  camera.cx_px = intrinsics[2];
  camera.cy_px = intrinsics[5];
  if (!(camera.fx_px > 0) || !(camera.fy_px > 0))
    fields.fail("intrinsics has a focal length that is not positive");
  fields.matrix("world_to_camera", 3, 4, camera.view_from_world.data());
  if (fields.has("near")) {
    camera.near_m = static_cast<float>(fields.number("near"));
    if (!(camera.near_m > 0)) fields.fail("near is not positive");
  }
  return camera;
}

// An entry of cameras.json: the axes of the camera, OpenCV's, as columns in the world, and where it
// stands. It has no principal point: images of the original trainer are centred.
FileCamera read_3dgs(Fields& fields) {
  FileCamera camera;
  double rotation[9] = {}, position[3] = {};
  fields.matrix("rotation", 3, 3, rotation);
  fields.vector3("position", position);
  set_view(rotation, position, camera);
  camera.fx_px = fields.focal_length("fx");
  camera.fy_px = fields.focal_length("fy");
  camera.width_px = fields.side("width");
  camera.height_px = fields.side("height");
  camera.cx_px = fields.has("cx") ? fields.number("cx") : 0.5 * camera.width_px;
  camera.cy_px = fields.has("cy") ? fields.number("cy") : 0.5 * camera.height_px;
  return camera;
}

// The intrinsics of a frame stand in it or, for all, beside the frames.
class NerfIntrinsics {
 public:
  NerfIntrinsics(Fields& frame, Fields& shared) : frame_(frame), shared_(shared) {}

  void read(FileCamera& camera) {
    const bool sized = has("w") || has("h");
    if (sized) {
      camera.width_px = of("w").side("w");
      camera.height_px = of("h").side("h");
    }
    if (has("fl_x")) {
      camera.fx_px = of("fl_x").focal_length("fl_x");
      camera.fy_px = has("fl_y") ? of("fl_y").focal_length("fl_y") : camera.fx_px;
      if (!sized && !(has("cx") && has("cy"))) frame_.fail("there is no w and h beside fl_x");
    } else if (has("camera_angle_x")) {
      const double angle = angle_of("camera_angle_x");
      if (!sized) {
        camera.horizontal_fov_rad = angle;
        return;
      }
      camera.fx_px = 0.5 * camera.width_px / std::tan(0.5 * angle);
      camera.fy_px = has("camera_angle_y")
                         ? 0.5 * camera.height_px / std::tan(0.5 * angle_of("camera_angle_y"))
                         : camera.fx_px;
    } else {
      frame_.fail("there is neither fl_x nor camera_angle_x");
    }
    camera.cx_px = has("cx") ? of("cx").number("cx") : 0.5 * camera.width_px;
    camera.cy_px = has("cy") ? of("cy").number("cy") : 0.5 * camera.height_px;
  }

  // The first of the lens's coefficients that is not zero.
  std::string distortion() {
    for (const char* field : {"k1", "k2", "k3", "k4", "p1", "p2"}) {
      if (has(field) && of(field).number(field) != 0) return field;
    }
    return "";
  }

 private:
  bool has(const char* field) const { return frame_.has(field) || shared_.has(field); }
  Fields& of(const char* field) { return frame_.has(field) ? frame_ : shared_; }
  double angle_of(const char* field) {
    const double angle = of(field).number(field);
    if (angle > 0 && angle < 3.14) return angle;
    of(field).fail(std::string(field) + " is not an angle from 0 to 3.14 radians");
    return 1;
  }

  Fields& frame_;
  Fields& shared_;
};

bool is_pinhole(const std::string& model) {
  constexpr const char* kPinholes[] = {
      "", "OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "perspective"};
  return std::find(std::begin(kPinholes), std::end(kPinholes), model) != std::end(kPinholes);
}

// A frame of transforms.json: camera to world in OpenGL's axes, x right, y up, z back.
FileCamera read_nerf(Fields& frame, Fields& shared, const std::string& model) {
  FileCamera camera;
  double matrix[12] = {}, rotation[9], centre[3];
  frame.matrix("transform_matrix", 3, 4, matrix);
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c)
      rotation[3 * r + c] = c == 0 ? matrix[4 * r] : -matrix[4 * r + c];
    centre[r] = matrix[4 * r + 3];
  }
  set_view(rotation, centre, camera);
  if (!is_pinhole(model))
    frame.fail("camera_model " + model.substr(0, 40) + " is no pinhole", StatusCode::kUnsupported);
  NerfIntrinsics intrinsics(frame, shared);
  intrinsics.read(camera);
  if (const std::string field = intrinsics.distortion(); !field.empty())
    camera.said = "lens distortion (" + field + ") not drawn";
  return camera;
}

std::string text_of(const Json& object, const char* field) {
  return object.contains(field) && object[field].is_string() ? object[field].get<std::string>()
                                                             : "";
}

// The image's name of an entry, without its folders.
std::string image_name(const Json& entry) {
  std::string name = text_of(entry, "img_name");
  if (name.empty()) name = text_of(entry, "file_path");
  return name.substr(name.find_last_of('/') + 1);
}

// Which of several is meant: a number, or the name of an image with or without its suffix.
Result<size_t> choose(const Json& list, const std::string& which, const std::string& name) {
  const auto invalid = [&](const std::string& what) {
    return Status(StatusCode::kInvalidArgument, name + ": " + what);
  };
  if (list.empty()) return invalid("holds no camera");
  if (which.empty()) return size_t{0};
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string image = list[i].is_object() ? image_name(list[i]) : "";
    if (!image.empty() && (image == which || image.substr(0, image.find_last_of('.')) == which))
      return i;
  }
  size_t index = 0;
  const auto [stop, error] = std::from_chars(which.data(), which.data() + which.size(), index);
  if (error != std::errc() || stop != which.data() + which.size())
    return invalid("no camera is called '" + which + "'");
  if (index >= list.size()) {
    return invalid("camera " + which + ": there are " + std::to_string(list.size()) +
                   ", counted from 0");
  }
  return index;
}

enum class Kind : uint8_t { kOwn, k3dgs, kNerf };

Result<FileCamera> read_one(const Json& json, const Json& entry, Kind kind,
                            const std::string& where, const std::string& name) {
  if (!entry.is_object()) return Status(StatusCode::kInvalidArgument, where + ": not an object");
  Fields fields(entry, where), shared(json, name);
  FileCamera camera;
  const char* pose = "world_to_camera";
  if (kind == Kind::kOwn) {
    camera = read_own(fields);
  } else if (kind == Kind::k3dgs) {
    camera = read_3dgs(fields);
    pose = "rotation";
  } else {
    const Json& with_model = entry.contains("camera_model") ? entry : json;
    camera = read_nerf(fields, shared, text_of(with_model, "camera_model"));
    pose = "transform_matrix";
  }
  FIG_RETURN_IF_ERROR(fields.status());
  FIG_RETURN_IF_ERROR(shared.status());
  if (!is_rotation(camera))
    fields.fail(std::string(pose) + " is not a rotation (axes of length 1, at right angles)");
  FIG_RETURN_IF_ERROR(fields.status());
  return camera;
}

}  // namespace

Result<FileCamera> parse_camera_file(const std::string& text, const std::string& name,
                                     const std::string& which) {
  const auto invalid = [&](const std::string& what) {
    return Status(StatusCode::kInvalidArgument, name + ": " + what);
  };
  if (text.size() > kMaxFileBytes)
    return Status(StatusCode::kLimitExceeded, name + ": camera: more than 64 MiB");
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) return invalid("camera: no JSON");
  Kind kind = Kind::kOwn;
  if (json.is_array()) {
    kind = Kind::k3dgs;
  } else if (json.is_object() && json.contains("frames")) {
    kind = Kind::kNerf;
    if (!json["frames"].is_array()) return invalid("frames is not a list");
  } else if (!json.is_object()) {
    return invalid("camera: neither a JSON object nor a list of cameras");
  }
  if (kind == Kind::kOwn) {
    if (!which.empty()) return invalid("holds one camera, without #" + which);
    return read_one(json, json, kind, name + ": camera", name);
  }
  const Json& list = kind == Kind::k3dgs ? json : json["frames"];
  const Result<size_t> index = choose(list, which, name);
  if (!index.ok()) return index.status();
  const std::string number = std::to_string(*index);
  Result<FileCamera> camera = read_one(json, list[*index], kind, name + ": camera " + number, name);
  if (!camera.ok()) return camera;
  const std::string image = image_name(list[*index]);
  const std::string chosen = "camera " + number + " of " + std::to_string(list.size()) +
                             (image.empty() ? "" : " (" + image.substr(0, 60) + ")");
  camera->said = chosen + (camera->said.empty() ? "" : ", " + camera->said);
  return camera;
}

Result<Camera> fixed_camera(const FileCamera& file, std::optional<ImageSize> asked,
                            ImageSize otherwise, const std::array<double, 3>& origin_m) {
  const bool sized = file.width_px != 0;
  const ImageSize size =
      asked.value_or(sized ? ImageSize{file.width_px, file.height_px} : otherwise);
  Camera camera{.width_px = size.width_px, .height_px = size.height_px, .near_m = file.near_m};
  double factor = 1;
  if (sized) {
    if (uint64_t(file.width_px) * size.height_px != uint64_t(file.height_px) * size.width_px) {
      return Status(StatusCode::kInvalidArgument,
                    "size: " + std::to_string(size.width_px) + "x" +
                        std::to_string(size.height_px) + " has another shape than the camera's " +
                        std::to_string(file.width_px) + "x" + std::to_string(file.height_px));
    }
    factor = static_cast<double>(size.width_px) / file.width_px;
  }
  if (file.horizontal_fov_rad) {
    camera.fx_px =
        static_cast<float>(0.5 * size.width_px / std::tan(0.5 * *file.horizontal_fov_rad));
    camera.fy_px = camera.fx_px;
    camera.cx_px = 0.5f * static_cast<float>(size.width_px);
    camera.cy_px = 0.5f * static_cast<float>(size.height_px);
  } else {
    camera.fx_px = static_cast<float>(file.fx_px * factor);
    camera.fy_px = static_cast<float>(file.fy_px * factor);
    camera.cx_px = static_cast<float>(file.cx_px * factor);
    camera.cy_px = static_cast<float>(file.cy_px * factor);
  }
  for (size_t r = 0; r < 3; ++r) {
    double translation = file.view_from_world[4 * r + 3];
    for (size_t k = 0; k < 3; ++k) {
      camera.view_from_world[4 * r + k] = static_cast<float>(file.view_from_world[4 * r + k]);
      translation += file.view_from_world[4 * r + k] * origin_m[k];
    }
    camera.view_from_world[4 * r + 3] = static_cast<float>(translation);
  }
  FIG_RETURN_IF_ERROR(validate_camera(camera));
  return camera;
}

}  // namespace figurine::samples
