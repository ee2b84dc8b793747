#include "toolchain/dataset/layouts.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "figurine/pose.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

namespace fs = std::filesystem;

constexpr double kPersonHeight_m = 1.7;
constexpr double kLeastPerson_px = 8;

// Whether the camera can show a person whose root is there.
bool may_show(const Camera& camera, const std::array<double, 3>& root_m) {
  std::array<double, 3> at{};
  for (size_t r = 0; r < 3; ++r) {
    const float* m = &camera.view_from_world[4 * r];
    at[r] = m[0] * root_m[0] + m[1] * root_m[1] + m[2] * root_m[2] + m[3];
  }
  if (!(at[2] > 0) || !(camera.fy_px * kPersonHeight_m / at[2] >= kLeastPerson_px)) return false;
  const double x = camera.fx_px * at[0] / at[2] + camera.cx_px,
               y = camera.fy_px * at[1] / at[2] + camera.cy_px;
  const double width = camera.width_px, height = camera.height_px;
  return x > -width && x < 2 * width && y > -height && y < 2 * height;
}

}  // namespace

void take_shape(const std::vector<float>& shapes, const DatasetOptions& options,
                const std::string& where, DatasetParts& parts) {
  const size_t used = std::min<size_t>(shapes.size(), options.body->shape_count());
  parts.shape.assign(shapes.begin(), shapes.begin() + static_cast<std::ptrdiff_t>(used));
  const bool cut = std::any_of(shapes.begin() + static_cast<std::ptrdiff_t>(used), shapes.end(),
                               [](float value) { return value != 0; });
  if (cut) {
    parts.remarks.push_back("of " + counted(shapes.size(), "shape coefficient") +
                            " the body has directions for " + std::to_string(used));
  }
  check_shape(*options.body, parts.shape, where);
}

void check_intrinsics(const std::vector<double>& k, const std::string& where) {
  const double small = 1e-6 * std::max(1.0, std::abs(k[0]));
  if (std::abs(k[6]) > small || std::abs(k[7]) > small || std::abs(k[8] - 1) > 1e-6)
    throw InputError(where + ": the last row is not 0 0 1; is the matrix transposed?");
  if (std::abs(k[1]) > 1e-3 * std::abs(k[0]) || std::abs(k[3]) > small)
    throw InputError(where + ": has skew, which is not read");
  if (!(k[0] > 0 && k[4] > 0)) throw InputError(where + ": focal lengths must be positive");
}

std::string counted(uint64_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::optional<uint32_t> leading_number(const std::string& name) {
  size_t digits = 0;
  while (digits < name.size() && name[digits] >= '0' && name[digits] <= '9') ++digits;
  if (digits == 0 || digits > 9) return std::nullopt;
  return static_cast<uint32_t>(std::stoul(name.substr(0, digits)));
}

NumberedFiles numbered_pictures(const std::string& folder) {
  NumberedFiles files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    const std::optional<uint32_t> number = leading_number(name);
    if (!number || !is_picture_name(name)) continue;
    if (!files.emplace(*number, it->path().string()).second)
      throw InputError(folder + ": two files of number " + std::to_string(*number));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw InputError(folder + ": " + error.message());
  return files;
}

std::string existing_folder(const fs::path& root, const std::vector<std::string>& names,
                            const char* what) {
  std::string all;
  for (const std::string& name : names) {
    if (fs::is_directory(root / name)) return name;
    all += (all.empty() ? "" : ", ") + name;
  }
  throw InputError(root.string() + ": no folder of " + what + ": one of " + all + " is expected");
}

void match_files(const std::vector<CameraFiles>& files, DatasetParts& parts) {
  std::string first;
  for (size_t c = 0; c < parts.cameras.size(); ++c) {
    std::vector<std::string>&images = parts.images.emplace_back(),
    &masks = parts.masks.emplace_back();
    for (const CaptureFrame& frame : parts.frames) {
      const auto image = files[c].images.find(frame.number),
                 mask = files[c].masks.find(frame.number);
      const bool there = image != files[c].images.end() && mask != files[c].masks.end();
      images.push_back(there ? image->second : "");
      masks.push_back(there ? mask->second : "");
      if (there) continue;
      ++parts.images_left_out;
      if (first.empty()) {
        first = "camera " + parts.cameras[c].name + ", frame " + std::to_string(frame.number) +
                (image == files[c].images.end() ? "" : ", has no mask");
      }
    }
  }
  if (parts.images_left_out > 0) {
    parts.remarks.push_back(counted(parts.images_left_out, "image") + " missing, left out (" +
                            first + (parts.images_left_out > 1 ? " and others)" : ")"));
  }
  const bool none = std::all_of(parts.images.begin(), parts.images.end(), [](const auto& camera) {
    return std::all_of(camera.begin(), camera.end(), [](const auto& path) { return path.empty(); });
  });
  if (none) throw InputError(parts.directory + ": no image has a mask of the same number");
}

void split_by_rule(DatasetParts& parts) {
  const Split split = default_split(static_cast<uint32_t>(parts.frames.size()),
                                    static_cast<uint32_t>(parts.cameras.size()));
  for (size_t f = 0; f < parts.frames.size(); ++f) parts.frames[f].split = split.frames[f];
  for (size_t c = 0; c < parts.cameras.size(); ++c)
    parts.cameras[c].held_out = split.held_out_camera[c];
}

void leave_out_blind_cameras(const DatasetOptions& options, const std::string& what,
                             DatasetParts& parts) {
  if (options.body == nullptr) return;
  const std::array<double, 3> rest = root_rest_position(*options.body, parts.shape);
  std::vector<std::array<double, 3>> roots;
  for (const CaptureFrame& frame : parts.frames) {
    std::array<double, 3> root = rest;
    for (size_t i = 0; i < 3; ++i) root[i] += frame.root_translation_m[i];
    roots.push_back(root);
  }
  std::string blind;
  for (size_t c = 0; c < parts.cameras.size();) {
    const Camera& camera = parts.cameras[c].camera;
    if (std::any_of(roots.begin(), roots.end(),
                    [&](const auto& root) { return may_show(camera, root); })) {
      ++c;
      continue;
    }
    blind += (blind.empty() ? "" : ", ") + parts.cameras[c].name;
    ++parts.cameras_left_out;
    const auto at = static_cast<std::ptrdiff_t>(c);
    parts.cameras.erase(parts.cameras.begin() + at);
    parts.images.erase(parts.images.begin() + at);
    parts.masks.erase(parts.masks.begin() + at);
  }
  if (parts.cameras.empty()) {
    throw InputError(what +
                     ": no camera sees the person: where the poses put the root, it is behind "
                     "them, far outside their images or smaller than 8 pixels; are units, scale "
                     "and axes right?");
  }
  if (!blind.empty())
    parts.remarks.push_back("cameras that never see the person, left out: " + blind);
}

}  // namespace figurine::dataset
