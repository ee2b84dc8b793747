// Files of Gaussians, and where to look at them from: few of them say what is up, none how large
// the scene is, or what of it is the subject.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "figurine/camera.h"
#include "figurine/status.h"
#include "ports/gaussians/gaussian_cloud.h"
#include "samples/common/parse.h"

namespace figurine::samples {

using ports::GaussianCloud;

inline constexpr ImageSize kSceneSize{1024, 768};

// The file's axes that may point up, for --up.
inline const std::vector<std::string> kUpAxes{"+y", "-y", "+z", "-z", "+x", "-x"};

// read_gaussians() of the file.
Result<GaussianCloud> read_scene(const std::string& path);

// In the axes of somebody who stands upright in the scene. As wanted, around the scene's middle; or
// from the front, at a distance at which the whole scene is in the picture, to three standard
// deviations of every Gaussian that can be seen, but for what lies three times as far out as nine
// tenths of them: captured scenes trail off into a background that no picture can hold.
OrbitCamera orbit_scene(const GaussianCloud& cloud, const std::optional<OrbitCamera>& wanted,
                        const std::string& up, ImageSize size);
// The camera on the orbit, in the axes of the file; it sees from a tenth of its distance on, or
// from where cameras do by default, if that is nearer.
Result<Camera> scene_camera(const OrbitCamera& orbit, const std::string& up, ImageSize size);

}  // namespace figurine::samples
