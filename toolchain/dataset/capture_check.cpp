#include "toolchain/dataset/capture_check.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

constexpr uint32_t kBodyJoints = 22;
constexpr uint8_t kInside = 128;
constexpr double kLeastOverlap = 0.4, kLeastJoints = 0.75;
constexpr double kBlurred = 0.3;  // of the median camera's sharpness

struct Point {
  float x = 0, y = 0, z = 0;  // pixels; metres in front
};

struct PosedPerson {
  std::vector<std::array<float, 3>> texels, joints;  // world
};

class Poser {
 public:
  Poser(const Body& body, const std::vector<float>& shape)
      : body_(body),
        joints_(body.joint_position_m.size()),
        texels_(body.texel_position_m.size()),
        transforms_(body.joint_count()) {
    shape_body(body, shape, joints_, texels_);
  }

  PosedPerson pose(const PoseView& pose) {
    skinning_transforms({body_.parents, joints_}, pose, transforms_);
    PosedPerson person;
    for (size_t i = 0; i < body_.texel_count(); ++i) {
      const Affine transform = blend(transforms_, &body_.texel_joints[i * kSkinInfluences],
                                     &body_.texel_weights[i * kSkinInfluences]);
      person.texels.push_back(transform_point(transform, &texels_[3 * i]));
    }
    for (size_t j = 0; j < body_.joint_count(); ++j)
      person.joints.push_back(transform_point(transforms_[j], &joints_[3 * j]));
    return person;
  }

 private:
  const Body& body_;
  std::vector<float> joints_, texels_;
  std::vector<Affine> transforms_;
};

std::optional<Point> project(const Camera& camera, const std::array<float, 3>& world) {
  const std::array<float, 3> at = transform_point({camera.view_from_world}, world.data());
  if (!(at[2] > 0.01f)) return std::nullopt;
  return Point{camera.fx_px * at[0] / at[2] + camera.cx_px,
               camera.fy_px * at[1] / at[2] + camera.cy_px, at[2]};
}

// A picture of one channel into which discs are drawn.
void draw_disc(const Point& at, float radius_px, ports::ImageU8& image) {
  const auto clamp = [](float value, uint32_t side) {
    return static_cast<int64_t>(std::clamp(value, -1.0f, static_cast<float>(side)));
  };
  for (int64_t y = clamp(at.y - radius_px, image.height_px);
       y <= clamp(at.y + radius_px, image.height_px); ++y) {
    for (int64_t x = clamp(at.x - radius_px, image.width_px);
         x <= clamp(at.x + radius_px, image.width_px); ++x) {
      if (x < 0 || y < 0 || x >= image.width_px || y >= image.height_px) continue;
      const float dx = static_cast<float>(x) + 0.5f - at.x,
                  dy = static_cast<float>(y) + 0.5f - at.y;
      if (dx * dx + dy * dy <= radius_px * radius_px)
        *image.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y)) = 255;
    }
  }
}

ports::ImageU8 silhouette(const Body& body, const PosedPerson& person, const Camera& camera) {
  ports::ImageU8 image(camera.width_px, camera.height_px, 1);
  for (size_t i = 0; i < person.texels.size(); ++i) {
    const std::optional<Point> at = project(camera, person.texels[i]);
    if (!at) continue;
    const float radius = 0.75f * body.texel_spacing_m[i] * camera.fx_px / at->z;
    draw_disc(*at, std::clamp(radius, 0.75f, 100.0f), image);
  }
  return image;
}

// To the nearest pixel inside; the picture's diagonal if there is none.
double distance_to_mask(const CaptureImage& image, const Point& at) {
  const auto width = static_cast<int64_t>(image.width_px),
             height = static_cast<int64_t>(image.height_px), x0 = static_cast<int64_t>(at.x),
             y0 = static_cast<int64_t>(at.y);
  double best = std::hypot(width, height);
  for (int64_t y = 0; y < height; ++y) {
    if (std::abs(static_cast<double>(y - y0)) >= best) continue;
    for (int64_t x = 0; x < width; ++x) {
      if (image.alpha[static_cast<size_t>(y * width + x)] >= kInside)
        best = std::min(best, std::hypot(x - x0, y - y0));
    }
  }
  return best;
}

double sharpness(const CaptureImage& image) {
  const size_t width = image.width_px;
  const auto grey = [&](size_t i) {
    return 0.299 * image.rgb[3 * i] + 0.587 * image.rgb[3 * i + 1] + 0.114 * image.rgb[3 * i + 2];
  };
  double sum = 0, squares = 0;
  size_t count = 0;
  for (size_t y = 1; y + 1 < image.height_px; ++y) {
    for (size_t x = 1; x + 1 < width; ++x) {
      const size_t i = y * width + x;
      const auto inside = [&](size_t at) { return image.alpha[at] == 255; };
      if (!inside(i) || !inside(i - 1) || !inside(i + 1) || !inside(i - width) ||
          !inside(i + width))
        continue;
      const double edge =
          grey(i - 1) + grey(i + 1) + grey(i - width) + grey(i + width) - 4 * grey(i);
      sum += edge, squares += edge * edge, ++count;
    }
  }
  if (count == 0) return 0;
  const double mean = sum / static_cast<double>(count);
  return squares / static_cast<double>(count) - mean * mean;
}

ViewCheck check_view(const CaptureImage& image, const ports::ImageU8& body,
                     const PosedPerson& person, const Camera& camera) {
  ViewCheck check;
  size_t both = 0, either = 0, of_body = 0;
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    const bool in_mask = image.alpha[i] >= kInside, in_body = body.pixels[i] != 0;
    both += in_mask && in_body, either += in_mask || in_body, of_body += in_body;
  }
  const auto share = [](size_t part, size_t whole) {
    return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
  };
  check.overlap = share(both, either);
  check.body_in_mask = share(both, of_body);
  size_t seen = 0, inside = 0;
  double distance = 0;
  for (uint32_t j = 0; j < std::min<size_t>(kBodyJoints, person.joints.size()); ++j) {
    const std::optional<Point> at = project(camera, person.joints[j]);
    if (!at || !(at->x >= 0 && at->y >= 0 && at->x < static_cast<float>(camera.width_px) &&
                 at->y < static_cast<float>(camera.height_px)))
      continue;
    ++seen;
    const size_t pixel = static_cast<size_t>(at->y) * camera.width_px + static_cast<size_t>(at->x);
    if (image.alpha[pixel] >= kInside) {
      ++inside;
    } else {
      distance += distance_to_mask(image, *at);
    }
  }
  check.joints_in_mask = share(inside, seen);
  check.joint_distance_px = seen == 0 ? 0 : distance / static_cast<double>(seen);
  check.sharpness = sharpness(image);
  return check;
}

void draw_line(const Point& from, const Point& to, ports::ImageU8& layer) {
  const float length = std::hypot(to.x - from.x, to.y - from.y);
  if (!(length < 1e4f)) return;
  const int steps = std::max(1, static_cast<int>(length));
  for (int i = 0; i <= steps; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(steps);
    draw_disc({from.x + share * (to.x - from.x), from.y + share * (to.y - from.y), 1}, 0.75f,
              layer);
  }
}

ports::ImageU8 overlay(const CaptureImage& image, const ports::ImageU8& body,
                       const PosedPerson& person, const Body& model, const Camera& camera) {
  ports::ImageU8 bones(camera.width_px, camera.height_px, 1),
      joints(camera.width_px, camera.height_px, 1), out(camera.width_px, camera.height_px, 3);
  for (size_t j = 0; j < person.joints.size(); ++j) {
    const std::optional<Point> at = project(camera, person.joints[j]);
    if (!at) continue;
    if (j < kBodyJoints) draw_disc(*at, 2.5f, joints);
    if (model.parents[j] < 0) continue;
    if (const auto parent = project(camera, person.joints[static_cast<size_t>(model.parents[j])]))
      draw_line(*parent, *at, bones);
  }
  for (size_t i = 0; i < body.pixels.size(); ++i) {
    const bool on_joint = joints.pixels[i] != 0, on_bone = bones.pixels[i] != 0;
    const std::array<int, 3> colour = on_joint  ? std::array<int, 3>{255, 255, 255}
                                      : on_bone ? std::array<int, 3>{255, 200, 40}
                                                : std::array<int, 3>{255, 60, 40};
    const int weight = on_joint || on_bone ? 255 : body.pixels[i] != 0 ? 96 : 0;
    for (size_t c = 0; c < 3; ++c) {
      out.pixels[3 * i + c] =
          static_cast<uint8_t>((image.rgb[3 * i + c] * (255 - weight) + colour[c] * weight) / 255);
    }
  }
  return out;
}

void add(const ViewCheck& view, double weight, ViewCheck& mean) {
  mean.overlap += weight * view.overlap;
  mean.body_in_mask += weight * view.body_in_mask;
  mean.joints_in_mask += weight * view.joints_in_mask;
  mean.joint_distance_px += weight * view.joint_distance_px;
  mean.sharpness += weight * view.sharpness;
}

void judge(const Dataset& data, CaptureCheck& check) {
  std::vector<double> sharp;
  for (const CameraCheck& camera : check.cameras) sharp.push_back(camera.mean.sharpness);
  std::sort(sharp.begin(), sharp.end());
  const double median = sharp.empty() ? 0 : sharp[sharp.size() / 2];
  for (CameraCheck& camera : check.cameras) {
    // Head and shoulders are cut by the image's border; what is there must still fit.
    const bool whole = data.cameras()[camera.camera].framing == Framing::kBody;
    if (whole && camera.mean.overlap < kLeastOverlap) {
      camera.trouble = "body and mask lie apart: calibration, pose, frame numbers or person?";
    } else if (camera.mean.joints_in_mask < kLeastJoints) {
      camera.trouble = "joints lie outside the mask: pose or calibration?";
    } else if (camera.mean.sharpness < kBlurred * median) {
      camera.trouble = "blurred beside the others: focus or motion?";
    }
  }
}

}  // namespace

size_t CaptureCheck::misfits() const {
  return static_cast<size_t>(
      std::count_if(cameras.begin(), cameras.end(), [](const CameraCheck& camera) {
        return !camera.trouble.empty() && !camera.trouble.starts_with("blurred");
      }));
}

CaptureCheck check_capture(
    const Dataset& data, const Body& body, uint32_t frames,
    const std::function<void(const ViewCheck&, const ports::ImageU8&)>& draw) {
  const size_t all = data.frames().size(),
               count = frames == 0 ? all : std::min<size_t>(frames, all);
  Poser poser(body, data.shape());
  CaptureCheck result;
  result.cameras.resize(data.cameras().size());
  for (size_t i = 0; i < count; ++i) {
    const size_t frame = i * all / count;
    const PosedPerson person = poser.pose(data.frames()[frame].pose());
    for (size_t c = 0; c < data.cameras().size(); ++c) {
      if (!data.has_image(frame, c)) continue;
      const Camera& camera = data.cameras()[c].camera;
      const CaptureImage image = data.load_image(frame, c);
      const ports::ImageU8 seen = silhouette(body, person, camera);
      ViewCheck view = check_view(image, seen, person, camera);
      view.frame = frame, view.camera = c;
      if (draw) draw(view, overlay(image, seen, person, body, camera));
      ++result.cameras[c].views;
      add(view, 1, result.cameras[c].mean);
      result.views.push_back(view);
    }
  }
  for (size_t c = 0; c < result.cameras.size(); ++c) {
    CameraCheck& camera = result.cameras[c];
    camera.camera = c;
    if (camera.views == 0) continue;
    ViewCheck mean;
    add(camera.mean, 1.0 / static_cast<double>(camera.views), mean);
    camera.mean = mean;
  }
  std::erase_if(result.cameras, [](const CameraCheck& camera) { return camera.views == 0; });
  judge(data, result);
  return result;
}

}  // namespace figurine::dataset
