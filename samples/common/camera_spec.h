// --camera: "orbit:AZ,EL,DIST[,FOV]" (degrees, metres, vertical field of view) or the name of a
// JSON file (docs/json.md, "Camera").
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "figurine/camera.h"
#include "figurine/status.h"
#include "samples/common/parse.h"

namespace figurine::samples {

// Neither: the tool frames what it draws. The orbit's target is the tool's business, too.
struct CameraSpec {
  std::optional<OrbitCamera> orbit;
  std::optional<Camera> fixed;  // width_px = height_px = 0 if the file has no size
};

// Reads and checks the file, if it is one. Errors name the option or the file and the field.
Result<CameraSpec> parse_camera_spec(const std::string& text);
Result<Camera> parse_camera_json(const std::string& json, const std::string& name);

// What parse_camera_json reads, value for value.
nlohmann::ordered_json camera_json(const Camera& camera);

// The fixed camera at the size asked for: same picture, other resolution. kInvalidArgument if the
// shapes of the two images differ.
Result<Camera> resize_camera(const Camera& camera, ImageSize size);

}  // namespace figurine::samples
