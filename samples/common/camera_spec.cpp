#include "samples/common/camera_spec.h"

#include <nlohmann/json.hpp>

#include "ports/host/files.h"

namespace figurine::samples {

namespace {

Status invalid(const std::string& where, const std::string& what) {
  return Status(StatusCode::kInvalidArgument, where + ": " + what);
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
  std::string path = text, which;
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  const size_t hash = text.find_last_of('#');
  if (!file.ok() && hash != std::string::npos) {
    path = text.substr(0, hash);
    which = text.substr(hash + 1);
    if (which.empty()) return invalid("camera '" + text + "'", "nothing behind #");
    file = ports::MappedFile::open(path);
  }
  if (!file.ok()) return file.status().within("camera");
  const std::string json(reinterpret_cast<const char*>(file->bytes().data()), file->bytes().size());
  Result<FileCamera> camera = parse_camera_file(json, path, which);
  if (!camera.ok()) return camera.status();
  spec.fixed = std::move(*camera);
  return spec;
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

}  // namespace figurine::samples
