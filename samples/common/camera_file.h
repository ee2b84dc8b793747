// Cameras in JSON files, as people have them: figurine's own (docs/json.md, "Camera"), cameras.json
// of the original 3DGS, and transforms.json of NeRFs. docs/formats.md has the fields of each.
//
// All become pinholes in OpenCV axes. Poses stay in double: scenes may lie thousands of kilometres
// from where their coordinates begin. Based on: Kerbl et al., 2023 (reference code, cameras.json);
// Mildenhall et al., NeRF, 2020 and Nerfstudio (transforms.json).
#pragma once

#include <array>
#include <optional>
#include <string>

#include "figurine/camera.h"
#include "figurine/status.h"
#include "samples/common/parse.h"

namespace figurine::samples {

struct FileCamera {
  uint32_t width_px = 0, height_px = 0;  // both 0: the file does not say
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  // In place of those four where the file has an angle and no size; the principal point is the
  // middle then.
  std::optional<double> horizontal_fov_rad;
  std::array<double, 12> view_from_world{};  // [3,4] row-major, as in Camera
  float near_m = Camera{}.near_m;
  std::string said;  // of a file of several: "camera 3 of 185 (00042.png)"; and what is not read
};

// which: a number counted from 0, or an image's name; empty: the only one, or the first of several.
// kInvalidArgument names the file, the camera and the field; kUnsupported a camera that is no
// pinhole, kLimitExceeded a file of more than 64 MiB.
Result<FileCamera> parse_camera_file(const std::string& json, const std::string& name,
                                     const std::string& which);

// At the size asked for, else the file's, else otherwise: same picture, other resolution. In the
// coordinates whose zero is at origin_m of the file's. kInvalidArgument if the shapes of the two
// images differ, or the result is no sound camera (validate_camera).
Result<Camera> fixed_camera(const FileCamera& file, std::optional<ImageSize> asked,
                            ImageSize otherwise, const std::array<double, 3>& origin_m = {0, 0, 0});

}  // namespace figurine::samples
