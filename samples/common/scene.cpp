#include "samples/common/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "samples/common/quaternion.h"

namespace figurine::samples {

namespace {

// Rest positions [J,3] of the joints of the person's own template.
std::vector<float> rest_joints(const Avatar& avatar, const Body& body) {
  std::vector<float> joints(body.joint_position_m.begin(), body.joint_position_m.end());
  if (avatar.template_mode != TemplateMode::kShaped) return joints;
  for (size_t s = 0; s < avatar.shape.size(); ++s) {
    for (size_t k = 0; k < joints.size(); ++k)
      joints[k] += avatar.shape[s] * body.joint_shape_basis_m[s * joints.size() + k];
  }
  return joints;
}

// The motion of a figure, checked against its body; none where none is asked for.
Result<std::unique_ptr<LoadedPackage>> load_motion(const std::vector<std::string>& motions,
                                                   size_t index, const LoadedPackage& body) {
  if (motions.empty()) return std::unique_ptr<LoadedPackage>();
  Result<std::unique_ptr<LoadedPackage>> motion =
      load_package(motions[motions.size() == 1 ? 0 : index], PackageKind::kMotion);
  if (!motion.ok()) return motion;
  const Status fits = check_motion_fits_body((*motion)->package.motion(), body.package.body());
  if (!fits.ok()) return fits.within((*motion)->path + " on " + body.path);
  return motion;
}

// Side by side about the middle, unless places are given.
Result<Placement> place_of(const SceneOptions& options, size_t index) {
  if (!options.places.empty()) return parse_placement(options.places[index]);
  const auto last = static_cast<float>(options.avatars.size() - 1);
  return Placement{.x_m = options.spacing_m * (static_cast<float>(index) - 0.5f * last)};
}

}  // namespace

PoseView Scene::Figure::recorded_pose(uint32_t frame) const {
  if (motion) return motion->package.motion().pose(frame);
  const GoldenFrame& golden = avatar->avatar.golden;
  return {golden.root_translation_m, golden.rotations};
}

Result<Scene::Figure> Scene::load_figure(const SceneOptions& options, size_t index,
                                         std::span<const Figure> others) {
  Figure figure;
  Result<std::unique_ptr<LoadedAvatar>> avatar = load_avatar(options.avatars[index]);
  if (!avatar.ok()) return avatar.status();
  figure.avatar = std::move(*avatar);
  for (const Figure& other : others) {  // one body in memory, however many wear it
    if (options.body.empty() &&
        other.body->package.content_hash() == figure.avatar->avatar.body_hash)
      figure.body = other.body;
  }
  if (!figure.body) {
    Result<std::unique_ptr<LoadedPackage>> body = find_body(*figure.avatar, options.body);
    if (!body.ok()) return body.status();
    figure.body = std::move(*body);
  }
  Result<std::unique_ptr<LoadedPackage>> motion = load_motion(options.motions, index, *figure.body);
  if (!motion.ok()) return motion.status();
  figure.motion = std::move(*motion);
  const Result<Placement> place = place_of(options, index);
  if (!place.ok()) return place.status();
  figure.place = *place;
  const Body& body = figure.body->package.body();
  figure.rest_joints_m = rest_joints(figure.avatar->avatar, body);
  figure.rotations.resize(size_t(body.joint_count()) * 4);
  if (figure.motion) {
    figure.source = std::make_unique<MotionPoses>(figure.motion->package.motion());
  } else {
    figure.source = std::make_unique<StillPose>(figure.recorded_pose(0));
  }
  figure.swaying = std::make_unique<SwayPoses>(figure.recorded_pose(0));
  return figure;
}

Result<Scene> Scene::load(const SceneOptions& options) {
  const size_t count = options.avatars.size();
  if (options.motions.size() > 1 && options.motions.size() != count) {
    return Status(StatusCode::kInvalidArgument, "motion: give one for all or one for each of the " +
                                                    std::to_string(count) + " avatars");
  }
  if (!options.places.empty() && options.places.size() != count) {
    return Status(StatusCode::kInvalidArgument,
                  "place: give one for each of the " + std::to_string(count) + " avatars");
  }
  Scene scene;
  for (size_t i = 0; i < count; ++i) {
    Result<Figure> figure = load_figure(options, i, scene.figures_);
    if (!figure.ok()) return figure.status();
    if (figure->motion) {
      const Motion& clip = figure->motion->package.motion();
      scene.frame_count_ =
          i == 0 ? clip.frame_count : std::min(scene.frame_count_, clip.frame_count);
      if (i == 0) scene.frames_per_second_ = clip.frames_per_second;
    }
    scene.figures_.push_back(std::move(*figure));
  }
  scene.posed_.resize(count);
  return scene;
}

Result<std::vector<uint32_t>> Scene::frames(const FrameRange& range) const {
  const uint32_t end = range.end.value_or(frame_count_);
  if (range.first >= frame_count_ || end > frame_count_) {
    const std::string holds = figures_[0].motion
                                  ? "the motion has " + std::to_string(frame_count_) + " frames"
                                  : "without --motion there is one frame";
    return Status(StatusCode::kInvalidArgument, "frames " + std::to_string(range.first) + ":" +
                                                    std::to_string(end) + ": " + holds);
  }
  std::vector<uint32_t> frames;
  for (uint64_t frame = range.first; frame < end; frame += range.step)
    frames.push_back(static_cast<uint32_t>(frame));
  return frames;
}

Status Scene::add_to(Renderer& renderer, std::optional<Precision> precision) {
  for (size_t i = 0; i < figures_.size(); ++i) {
    const Result<AvatarId> id =
        renderer.add_avatar(figures_[i].avatar->avatar, figures_[i].body->package, precision);
    if (!id.ok()) return id.status().within(figures_[i].avatar->name);
    posed_[i].avatar = *id;
  }
  return {};
}

std::string Scene::precision(const Renderer& renderer) const {
  const Precision first = renderer.precision(posed_[0].avatar);
  const bool same = std::all_of(posed_.begin(), posed_.end(), [&](const FrameAvatar& each) {
    return renderer.precision(each.avatar) == first;
  });
  return same ? to_string(first) : "mixed";
}

bool Scene::holds(Precision precision) const {
  return std::all_of(figures_.begin(), figures_.end(),
                     [&](const Figure& figure) { return figure.avatar->avatar.holds(precision); });
}

std::span<const FrameAvatar> Scene::pose(uint32_t frame) {
  for (size_t i = 0; i < figures_.size(); ++i) place_figure(i, figures_[i].recorded_pose(frame));
  return posed_;
}

std::span<const FrameAvatar> Scene::sway(uint32_t moment) {
  for (size_t i = 0; i < figures_.size(); ++i)
    place_figure(i, *figures_[i].swaying->next(moment / SwayPoses::kMomentsPerSecond));
  return posed_;
}

Result<std::span<const FrameAvatar>> Scene::pose_at(double time_s) {
  for (size_t i = 0; i < figures_.size(); ++i) {
    const Result<PoseView> pose = figures_[i].source->next(time_s);
    if (!pose.ok()) return pose.status().within(figures_[i].avatar->name);
    place_figure(i, *pose);
  }
  return std::span<const FrameAvatar>(posed_);
}

void Scene::set_source(size_t figure, std::unique_ptr<PoseSource> source) {
  figures_[figure].source = std::move(source);
}

// p' = R_y(heading) p + place for the root's position p = rest + translation; the root's rotation
// turns with it.
void Scene::place_figure(size_t index, const PoseView& pose) {
  Figure& figure = figures_[index];
  std::copy(pose.rotations.begin(), pose.rotations.end(), figure.rotations.begin());
  figure.root_translation_m = pose.root_translation_m;
  const double heading = figure.place.heading_deg * std::numbers::pi / 180;
  if (heading != 0) {
    store_quaternion(rotation_about({0, 1, 0}, heading) * quaternion_at(figure.rotations.data()),
                     figure.rotations.data());
    const double x = figure.rest_joints_m[0] + pose.root_translation_m[0],
                 z = figure.rest_joints_m[2] + pose.root_translation_m[2];
    figure.root_translation_m[0] =
        static_cast<float>(std::cos(heading) * x + std::sin(heading) * z - figure.rest_joints_m[0]);
    figure.root_translation_m[2] = static_cast<float>(
        -std::sin(heading) * x + std::cos(heading) * z - figure.rest_joints_m[2]);
  }
  figure.root_translation_m[0] += figure.place.x_m;
  figure.root_translation_m[2] += figure.place.z_m;
  posed_[index].pose = {figure.root_translation_m, figure.rotations};
}

std::array<float, 3> Scene::joint_m(size_t figure, uint32_t joint) const {
  const Figure& f = figures_[figure];
  const Body& body = f.body->package.body();
  std::vector<Affine> world_from_rest(body.joint_count());
  skinning_transforms({body.parents, f.rest_joints_m}, {f.root_translation_m, f.rotations},
                      world_from_rest);
  return transform_point(world_from_rest[joint], &f.rest_joints_m[size_t(joint) * 3]);
}

std::array<float, 3> Scene::root_m(size_t figure) const {
  const Figure& f = figures_[figure];
  return {f.rest_joints_m[0] + f.root_translation_m[0],
          f.rest_joints_m[1] + f.root_translation_m[1],
          f.rest_joints_m[2] + f.root_translation_m[2]};
}

float Scene::heading_deg(size_t figure) const {
  const std::array<float, 9> r = rotation_from_quaternion(figures_[figure].rotations.data());
  // The root's +z axis on the ground.
  return static_cast<float>(std::atan2(r[2], r[8]) * 180 / std::numbers::pi);
}

}  // namespace figurine::samples
