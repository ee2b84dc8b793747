// Files of Gaussians, and where to look at them from: nothing in them says what is up, how large a
// scene is, or what of it is the subject.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "figurine/camera.h"
#include "figurine/status.h"
#include "ports/gaussians/ply.h"
#include "samples/common/parse.h"

namespace figurine::samples {

using ports::GaussianCloud;

inline constexpr ImageSize kSceneSize{1024, 768};

// The file's axes that may point up, for --up.
inline const std::vector<std::string> kUpAxes{"+y", "-y", "+z", "-z"};

// read_gaussian_ply() of the file; one without any Gaussian is refused.
Result<GaussianCloud> read_scene(const std::string& path);

// Around the scene's robust centre, in the axes of somebody who stands upright in it. None wanted:
// at a distance that frames the scene, from 25 degrees to the side and 12 above.
OrbitCamera orbit_scene(const GaussianCloud& cloud, const std::optional<OrbitCamera>& wanted,
                        const std::string& up, ImageSize size);
// The camera on the orbit, in the axes of the file.
Result<Camera> scene_camera(const OrbitCamera& orbit, const std::string& up, ImageSize size);

}  // namespace figurine::samples
