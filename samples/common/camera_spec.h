// --camera: "orbit:AZ,EL,DIST[,FOV]" (degrees, metres, vertical field of view), or "FILE[#N]", a
// camera of a JSON file (camera_file.h).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "figurine/camera.h"
#include "figurine/status.h"
#include "samples/common/camera_file.h"

namespace figurine::samples {

// Neither: the tool frames what it draws. The orbit's target is the tool's business, too.
struct CameraSpec {
  std::optional<OrbitCamera> orbit;
  std::optional<FileCamera> fixed;
};

// Reads and checks the file, if it is one: FILE#N is the file of that very name, if there is one.
// Errors name the option or the file and the field.
Result<CameraSpec> parse_camera_spec(const std::string& text);

// As figurine's own files have it, value for value.
nlohmann::ordered_json camera_json(const Camera& camera);

}  // namespace figurine::samples
