#include "samples/common/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

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

OpenOptions open_options(const SceneOptions& options) {
  OpenOptions open = options.open;
  open.pose_statistics = open.pose_statistics || options.keep_to_known;
  return open;
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

// Side by side about the middle, unless places are given; a crowd in rows and columns, heading by
// the golden angle, which repeats nothing.
Result<Placement> place_of(const SceneOptions& options, size_t index) {
  if (!options.places.empty()) return parse_placement(options.places[index]);
  const size_t count = options.avatars.size() * options.crowd;
  const auto from_middle = [&](size_t at, size_t places) {
    return options.spacing_m * (static_cast<float>(at) - 0.5f * static_cast<float>(places - 1));
  };
  if (options.crowd == 1) return Placement{.x_m = from_middle(index, count)};
  constexpr float kGoldenAngle_deg = 137.50776f;
  const auto columns = static_cast<size_t>(std::ceil(std::sqrt(static_cast<double>(count))));
  return Placement{
      .x_m = from_middle(index % columns, columns),
      .z_m = from_middle(index / columns, (count + columns - 1) / columns),
      .heading_deg = std::remainder(kGoldenAngle_deg * static_cast<float>(index), 360.0f)};
}

Status check_counts(const SceneOptions& options) {
  const size_t count = options.avatars.size();
  const auto check = [&](const char* option, size_t given, bool one_for_all) {
    if (given == 0 || given == count || (one_for_all && given == 1)) return Status();
    return Status(StatusCode::kInvalidArgument,
                  std::string(option) + ": give one " + (one_for_all ? "for all or one " : "") +
                      "for each of the " + std::to_string(count) + " avatars");
  };
  FIG_RETURN_IF_ERROR(check("motion", options.motions.size(), true));
  FIG_RETURN_IF_ERROR(check("pose", options.poses.size(), true));
  if (!options.poses.empty() && !options.motions.empty())
    return Status(StatusCode::kInvalidArgument, "pose: give a pose or a motion, not both");
  FIG_RETURN_IF_ERROR(check("coarse", options.coarse.size(), true));
  if (options.crowd > 1 && !options.places.empty())
    return Status(StatusCode::kInvalidArgument, "place: a crowd finds its own");
  return check("place", options.places.size(), false);
}

// The body of an avatar: one in memory, however many wear it.
template <class Figures>
Result<std::shared_ptr<LoadedPackage>> body_of(const LoadedAvatar& avatar, const std::string& named,
                                               const Figures& others) {
  for (const auto& other : others) {
    for (const std::shared_ptr<LoadedPackage>& body : {other.body, other.coarse_body}) {
      if (named.empty() && body && body->package.content_hash() == avatar.avatar.body_hash)
        return body;
    }
  }
  Result<std::unique_ptr<LoadedPackage>> body = find_body(avatar, named);
  if (!body.ok()) return body.status();
  return std::shared_ptr<LoadedPackage>(std::move(*body));
}

}  // namespace

PoseView Scene::Figure::recorded_pose(uint32_t frame) const {
  if (motion) {
    const Motion& clip = motion->package.motion();
    return clip.pose((frame + ahead_frames) % clip.frame_count);
  }
  if (pose) return pose->view();
  const GoldenFrame& golden = avatar->avatar.golden;
  return {golden.root_translation_m, golden.rotations};
}

Status Scene::load_packages(const SceneOptions& options, size_t index,
                            std::span<const Figure> others, Figure& figure) {
  Result<std::unique_ptr<LoadedAvatar>> avatar =
      load_avatar(options.avatars[index], open_options(options));
  if (!avatar.ok()) return avatar.status();
  figure.avatar = std::move(*avatar);
  Result<std::shared_ptr<LoadedPackage>> body = body_of(*figure.avatar, options.body, others);
  if (!body.ok()) return body.status();
  figure.body = std::move(*body);
  Result<std::unique_ptr<LoadedPackage>> motion = load_motion(options.motions, index, *figure.body);
  if (!motion.ok()) return motion.status();
  figure.motion = std::move(*motion);
  if (!options.poses.empty()) {
    Result<StoredPose> pose = load_pose_json(options.poses[options.poses.size() == 1 ? 0 : index],
                                             figure.body->package.body().joint_names);
    if (!pose.ok()) return pose.status();
    figure.pose = std::move(*pose);
  }
  return load_coarse(options, index, others, figure);
}

Status Scene::load_coarse(const SceneOptions& options, size_t index, std::span<const Figure> others,
                          Figure& figure) {
  if (options.coarse.empty()) return {};
  Result<std::unique_ptr<LoadedAvatar>> coarse =
      load_avatar(options.coarse[options.coarse.size() == 1 ? 0 : index], open_options(options));
  if (!coarse.ok()) return coarse.status();
  figure.coarse = std::move(*coarse);
  Result<std::shared_ptr<LoadedPackage>> body = body_of(*figure.coarse, "", std::span(&figure, 1));
  if (body.ok() && *body != figure.body) body = body_of(*figure.coarse, "", others);
  if (!body.ok()) return body.status();
  figure.coarse_body = std::move(*body);
  return check_coarse(figure, *figure.coarse, *figure.coarse_body);
}

Status Scene::check_coarse(const Figure& figure, const LoadedAvatar& coarse,
                           const LoadedPackage& body) {
  if (body.package.body().joint_count() == figure.body->package.body().joint_count()) return {};
  return Status(StatusCode::kInvalidArgument,
                coarse.name + ": its body's joints are not " + figure.avatar->name + "'s");
}

Status Scene::set_coarse(size_t index, const Coarse& coarse) {
  Figure& figure = figures_[index];
  if (coarse.avatar) FIG_RETURN_IF_ERROR(check_coarse(figure, *coarse.avatar, *coarse.body));
  figure.coarse = coarse.avatar, figure.coarse_body = coarse.body;
  return {};
}

Result<Scene::Figure> Scene::load_figure(const SceneOptions& options, size_t index,
                                         std::span<const Figure> others) {
  Figure figure;
  if (index < options.avatars.size()) {
    FIG_RETURN_IF_ERROR(load_packages(options, index, others, figure));
  } else {
    const Figure& first = others[index % options.avatars.size()];
    figure.avatar = first.avatar, figure.coarse = first.coarse;
    figure.body = first.body, figure.coarse_body = first.coarse_body;
    figure.motion = first.motion, figure.pose = first.pose;
  }
  constexpr uint32_t kAhead_frames = 29;  // about a second, and no part of a usual loop's length
  figure.ahead_frames = options.crowd > 1 ? kAhead_frames * static_cast<uint32_t>(index) : 0;
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

Status Scene::add_figure(const Newcomer& newcomer) {
  const Body& body = newcomer.body->package.body();
  Figure figure;
  figure.avatar = newcomer.avatar, figure.body = newcomer.body;
  figure.place = newcomer.place;
  figure.rest_joints_m = rest_joints(figure.avatar->avatar, body);
  figure.rotations.resize(size_t(body.joint_count()) * 4);
  figures_.push_back(std::move(figure));
  posed_.emplace_back();
  const Status fits = set_motion(figures_.size() - 1, newcomer.motion);
  if (!fits.ok()) remove_figure(figures_.size() - 1);
  return fits;
}

void Scene::remove_figure(size_t figure) {
  figures_.erase(figures_.begin() + static_cast<std::ptrdiff_t>(figure));
  posed_.erase(posed_.begin() + static_cast<std::ptrdiff_t>(figure));
  find_length();
}

void Scene::swap_figures(size_t a, size_t b) {
  std::swap(figures_[a], figures_[b]);
  std::swap(posed_[a], posed_[b]);
  find_length();
}

Status Scene::set_motion(size_t index, const std::shared_ptr<LoadedPackage>& motion) {
  Figure& figure = figures_[index];
  if (motion) {
    const Status fits =
        check_motion_fits_body(motion->package.motion(), figure.body->package.body());
    if (!fits.ok()) return fits.within(motion->path + " on " + figure.avatar->name);
  }
  figure.motion = motion;
  if (motion) {
    figure.source = std::make_unique<MotionPoses>(motion->package.motion());
  } else {
    figure.source = std::make_unique<StillPose>(figure.recorded_pose(0));
  }
  figure.swaying = std::make_unique<SwayPoses>(figure.recorded_pose(0));
  find_length();
  return {};
}

// Of the shortest motion, at the rate of the first.
void Scene::find_length() {
  frame_count_ = 1, frames_per_second_ = 30;
  bool first = true;
  for (const Figure& figure : figures_) {
    if (!figure.motion) continue;
    const Motion& clip = figure.motion->package.motion();
    frame_count_ = first ? clip.frame_count : std::min(frame_count_, clip.frame_count);
    if (std::exchange(first, false)) frames_per_second_ = clip.frames_per_second;
  }
}

Result<Scene> Scene::load(const SceneOptions& options) {
  FIG_RETURN_IF_ERROR(check_counts(options));
  const size_t count = options.avatars.size() * options.crowd;
  Scene scene;
  for (size_t i = 0; i < count; ++i) {
    Result<Figure> figure = load_figure(options, i, scene.figures_);
    if (!figure.ok()) return figure.status();
    scene.figures_.push_back(std::move(*figure));
  }
  scene.find_length();
  scene.posed_.resize(count);
  scene.keep_to_known(options.keep_to_known);
  return scene;
}

void Scene::keep_to_known(bool keep) {
  for (FrameAvatar& posed : posed_) posed.keep_to_known = keep;
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
  for (size_t i = 0; i < figures_.size(); ++i)
    FIG_RETURN_IF_ERROR(add_figure_to(renderer, i, precision));
  return {};
}

Status Scene::add_figure_to(Renderer& renderer, size_t index, std::optional<Precision> precision) {
  const Figure& figure = figures_[index];
  const Result<AvatarId> id =
      renderer.add_avatar(figure.avatar->avatar, figure.body->package, precision);
  if (!id.ok()) return id.status().within(figure.avatar->name);
  posed_[index].avatar = *id;
  posed_[index].coarse.reset();
  if (!figure.coarse) return {};
  const Result<AvatarId> coarse =
      renderer.add_avatar(figure.coarse->avatar, figure.coarse_body->package);
  if (!coarse.ok()) return coarse.status().within(figure.coarse->name);
  posed_[index].coarse = *coarse;
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
    place_figure(i, *figures_[i].swaying->next((moment + figures_[i].ahead_frames) /
                                               SwayPoses::kMomentsPerSecond));
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
