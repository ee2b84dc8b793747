#include "samples/common/camera_spec.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"

namespace figurine::samples {

namespace {

using Json = nlohmann::json;

Status invalid(const std::string& where, const std::string& what) {
  return Status(StatusCode::kInvalidArgument, where + ": " + what);
}

// Fills a row-major matrix of the wanted size from nested arrays of numbers; extra rows are allowed
// up to max_rows.
bool read_matrix(const Json& json, size_t rows, size_t max_rows, size_t columns, float* out) {
  if (!json.is_array() || json.size() < rows || json.size() > max_rows) return false;
  for (size_t r = 0; r < json.size(); ++r) {
    if (!json[r].is_array() || json[r].size() != columns) return false;
    for (size_t c = 0; c < columns; ++c) {
      if (!json[r][c].is_number()) return false;
      if (r < rows) out[r * columns + c] = json[r][c].get<float>();
    }
  }
  return true;
}

}  // namespace

Result<CameraSpec> parse_camera_spec(const std::string& text) {
  CameraSpec spec;
  const std::string prefix = "orbit:";
  if (text.starts_with(prefix)) {
    const std::optional<std::vector<double>> values =
        parse_numbers(std::string_view(text).substr(prefix.size()), 4);
    if (!values || values->size() < 3)
      return invalid("camera '" + text + "'", "not orbit:AZ,EL,DIST or orbit:AZ,EL,DIST,FOV");
    OrbitCamera orbit{.azimuth_deg = static_cast<float>((*values)[0]),
                      .elevation_deg = static_cast<float>((*values)[1]),
                      .distance_m = static_cast<float>((*values)[2])};
    if (values->size() == 4) orbit.vertical_fov_deg = static_cast<float>((*values)[3]);
    const Result<Camera> camera = make_orbit_camera(orbit, 16, 16);
    if (!camera.ok()) return camera.status().within("camera '" + text + "'");
    spec.orbit = orbit;
    return spec;
  }
  const Result<ports::MappedFile> file = ports::MappedFile::open(text);
  if (!file.ok()) return file.status().within("camera");
  const Result<Camera> camera = parse_camera_json(
      std::string(reinterpret_cast<const char*>(file->bytes().data()), file->bytes().size()), text);
  if (!camera.ok()) return camera.status();
  spec.fixed = *camera;
  return spec;
}

Result<Camera> parse_camera_json(const std::string& text, const std::string& name) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return invalid(name, "camera: not a JSON object");
  Camera camera;
  for (const char* side : {"width", "height"}) {
    if (!json.contains(side)) continue;
    const Json& value = json[side];
    if (!value.is_number_unsigned() || value.get<uint64_t>() < 1 || value.get<uint64_t>() > 16384) {
      return invalid(name,
                     std::string("camera: ") + side + " is not a whole number from 1 to 16384");
    }
    (side[0] == 'w' ? camera.width_px : camera.height_px) = value.get<uint32_t>();
  }
  if ((camera.width_px == 0) != (camera.height_px == 0))
    return invalid(name, "camera: width and height go together");
  float intrinsics[9];
  if (!json.contains("intrinsics") || !read_matrix(json["intrinsics"], 3, 3, 3, intrinsics)) {
    return invalid(name, "camera: intrinsics is not a 3x3 matrix of numbers");
  }
  if (intrinsics[1] != 0 || intrinsics[3] != 0 || intrinsics[6] != 0 || intrinsics[7] != 0 ||
      intrinsics[8] != 1) {
    return invalid(
        name, "camera: intrinsics is not [[fx,0,cx],[0,fy,cy],[0,0,1]] (skew is not supported)");
  }
  camera.fx_px = intrinsics[0];
  camera.cx_px = intrinsics[2];
  camera.fy_px = intrinsics[4];
  camera.cy_px = intrinsics[5];
  if (!json.contains("world_to_camera") ||
      !read_matrix(json["world_to_camera"], 3, 4, 4, camera.view_from_world.data())) {
    return invalid(name, "camera: world_to_camera is not a 3x4 or 4x4 matrix of numbers");
  }
  if (json.contains("near")) {
    if (!json["near"].is_number()) return invalid(name, "camera: near is not a number");
    camera.near_m = json["near"].get<float>();
  }
  Camera sized = camera;  // the size may come from the command line: anything else is checked now
  if (sized.width_px == 0) sized.width_px = sized.height_px = 16;
  const Status status = validate_camera(sized);
  if (!status.ok()) return status.within(name);
  return camera;
}

nlohmann::ordered_json camera_json(const Camera& camera) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int r = 0; r < 3; ++r) {
    const float* row = &camera.view_from_world[4 * r];
    rows.push_back({row[0], row[1], row[2], row[3]});
  }
  return {
      {"width", camera.width_px},
      {"height", camera.height_px},
      {"intrinsics", {{camera.fx_px, 0, camera.cx_px}, {0, camera.fy_px, camera.cy_px}, {0, 0, 1}}},
      {"world_to_camera", rows},
      {"near", camera.near_m}};
}

Result<Camera> resize_camera(const Camera& camera, ImageSize size) {
  Camera result = camera;
  result.width_px = size.width_px;
  result.height_px = size.height_px;
  if (camera.width_px == 0) return result;
  if (uint64_t(camera.width_px) * size.height_px != uint64_t(camera.height_px) * size.width_px) {
    return invalid("size", std::to_string(size.width_px) + "x" + std::to_string(size.height_px) +
                               " has another shape than the camera's " +
                               std::to_string(camera.width_px) + "x" +
                               std::to_string(camera.height_px));
  }
  const float factor = static_cast<float>(size.width_px) / static_cast<float>(camera.width_px);
  result.fx_px *= factor;
  result.fy_px *= factor;
  result.cx_px *= factor;
  result.cy_px *= factor;
  return result;
}

}  // namespace figurine::samples
