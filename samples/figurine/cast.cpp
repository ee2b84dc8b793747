#include "samples/figurine/cast.h"

#include <algorithm>
#include <cmath>

namespace figurine::samples {

namespace {

constexpr double kPi = 3.14159265358979323846;

// Hamilton product a b, wxyz.
std::array<float, 4> multiply(const std::array<float, 4>& a, const float* b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

// Rest position of the root joint of the person's own template.
std::array<float, 3> rest_root(const Avatar& avatar, const Body& body) {
  std::array<float, 3> root{body.joint_position_m[0], body.joint_position_m[1],
                            body.joint_position_m[2]};
  if (avatar.template_mode != TemplateMode::kShaped) return root;
  for (size_t s = 0; s < avatar.shape.size(); ++s) {
    for (size_t k = 0; k < 3; ++k)
      root[k] += avatar.shape[s] * body.joint_shape_basis_m[s * body.joint_position_m.size() + k];
  }
  return root;
}

}  // namespace

Result<Cast> Cast::load(const CastOptions& options) {
  const size_t count = options.avatars.size();
  if (options.motions.size() > 1 && options.motions.size() != count) {
    return Status(StatusCode::kInvalidArgument, "motion: give one for all or one for each of the " +
                                                    std::to_string(count) + " avatars");
  }
  if (!options.places.empty() && options.places.size() != count) {
    return Status(StatusCode::kInvalidArgument,
                  "place: give one for each of the " + std::to_string(count) + " avatars");
  }
  Cast cast;
  for (size_t i = 0; i < count; ++i) {
    Member member;
    Result<std::unique_ptr<LoadedAvatar>> avatar = load_avatar(options.avatars[i]);
    if (!avatar.ok()) return avatar.status();
    member.avatar = std::move(*avatar);
    for (const Member& other : cast.members_) {  // one body in memory, however many wear it
      if (options.body.empty() &&
          other.body->package.content_hash() == member.avatar->avatar.body_hash)
        member.body = other.body;
    }
    if (!member.body) {
      Result<std::unique_ptr<LoadedPackage>> body = find_body(*member.avatar, options.body);
      if (!body.ok()) return body.status();
      member.body = std::move(*body);
    }
    const Body& body = member.body->package.body();
    if (!options.motions.empty()) {
      Result<std::unique_ptr<LoadedPackage>> motion =
          load_package(options.motions.size() == 1 ? options.motions[0] : options.motions[i],
                       PackageKind::kMotion);
      if (!motion.ok()) return motion.status();
      member.motion = std::move(*motion);
      const Motion& clip = member.motion->package.motion();
      const Status fits = check_motion_fits_body(clip, body);
      if (!fits.ok()) return fits.within(member.motion->path + " on " + member.body->path);
      cast.frame_count_ = i == 0 ? clip.frame_count : std::min(cast.frame_count_, clip.frame_count);
      if (i == 0) cast.frames_per_second_ = clip.frames_per_second;
    }
    if (options.places.empty()) {
      member.place.x_m =
          options.spacing_m * (static_cast<float>(i) - 0.5f * static_cast<float>(count - 1));
    } else {
      const Result<Placement> place = parse_placement(options.places[i]);
      if (!place.ok()) return place.status();
      member.place = *place;
    }
    member.rest_root_m = rest_root(member.avatar->avatar, body);
    member.rotations.resize(size_t(body.joint_count()) * 4);
    cast.members_.push_back(std::move(member));
  }
  cast.posed_.resize(count);
  return cast;
}

Result<std::vector<uint32_t>> Cast::frames(const FrameRange& range) const {
  const uint32_t end = range.end.value_or(frame_count_);
  if (range.first >= frame_count_ || end > frame_count_) {
    const std::string holds = members_[0].motion
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

Status Cast::add_to(Renderer& renderer, std::optional<Precision> precision) {
  for (size_t i = 0; i < members_.size(); ++i) {
    const Result<AvatarId> id =
        renderer.add_avatar(members_[i].avatar->avatar, members_[i].body->package, precision);
    if (!id.ok()) return id.status().within(members_[i].avatar->name);
    posed_[i].avatar = *id;
  }
  return {};
}

std::string Cast::precision(const Renderer& renderer) const {
  const Precision first = renderer.precision(posed_[0].avatar);
  const bool same = std::all_of(posed_.begin(), posed_.end(), [&](const FrameAvatar& each) {
    return renderer.precision(each.avatar) == first;
  });
  return same ? to_string(first) : "mixed";
}

bool Cast::holds(Precision precision) const {
  return std::all_of(members_.begin(), members_.end(),
                     [&](const Member& member) { return member.avatar->avatar.holds(precision); });
}

std::span<const FrameAvatar> Cast::pose(uint32_t frame) {
  for (size_t i = 0; i < members_.size(); ++i) {
    const Member& member = members_[i];
    if (member.motion) {
      place_member(i, member.motion->package.motion().pose(frame));
    } else {
      const GoldenFrame& golden = member.avatar->avatar.golden;
      place_member(i, {golden.root_translation_m, golden.rotations});
    }
  }
  return posed_;
}

std::span<const FrameAvatar> Cast::sway(uint32_t moment) {
  pose(0);
  for (size_t i = 0; i < members_.size(); ++i) {
    Member& member = members_[i];
    for (size_t j = 0; j < member.rotations.size() / 4; ++j) {
      // Rates without a common period: no two moments of a run share a pose.
      const double angle = 0.05 * std::sin(0.37 * (moment + 1) + 2.399963 * static_cast<double>(j));
      const std::array<float, 4> turn{static_cast<float>(std::cos(angle)),
                                      j % 3 == 0 ? static_cast<float>(std::sin(angle)) : 0.0f,
                                      j % 3 == 1 ? static_cast<float>(std::sin(angle)) : 0.0f,
                                      j % 3 == 2 ? static_cast<float>(std::sin(angle)) : 0.0f};
      const std::array<float, 4> rotation = multiply(turn, &member.rotations[4 * j]);
      std::copy(rotation.begin(), rotation.end(), &member.rotations[4 * j]);
    }
  }
  return posed_;
}

// p' = R_y(heading) p + place for the root's position p = rest + translation; the root's rotation
// turns with it.
void Cast::place_member(size_t index, const PoseView& pose) {
  Member& member = members_[index];
  std::copy(pose.rotations.begin(), pose.rotations.end(), member.rotations.begin());
  member.root_translation_m = pose.root_translation_m;
  const double heading = member.place.heading_deg * kPi / 180;
  if (heading != 0) {
    const std::array<float, 4> turn{static_cast<float>(std::cos(0.5 * heading)), 0,
                                    static_cast<float>(std::sin(0.5 * heading)), 0};
    const std::array<float, 4> root = multiply(turn, member.rotations.data());
    std::copy(root.begin(), root.end(), member.rotations.begin());
    const double x = member.rest_root_m[0] + pose.root_translation_m[0],
                 z = member.rest_root_m[2] + pose.root_translation_m[2];
    member.root_translation_m[0] =
        static_cast<float>(std::cos(heading) * x + std::sin(heading) * z - member.rest_root_m[0]);
    member.root_translation_m[2] =
        static_cast<float>(-std::sin(heading) * x + std::cos(heading) * z - member.rest_root_m[2]);
  }
  member.root_translation_m[0] += member.place.x_m;
  member.root_translation_m[2] += member.place.z_m;
  posed_[index].pose = {member.root_translation_m, member.rotations};
}

std::array<float, 3> Cast::root_m(size_t member) const {
  const Member& m = members_[member];
  return {m.rest_root_m[0] + m.root_translation_m[0], m.rest_root_m[1] + m.root_translation_m[1],
          m.rest_root_m[2] + m.root_translation_m[2]};
}

float Cast::heading_deg(size_t member) const {
  const std::array<float, 9> r = rotation_from_quaternion(members_[member].rotations.data());
  return static_cast<float>(std::atan2(r[2], r[8]) * 180 /
                            kPi);  // the root's +z axis on the ground
}

}  // namespace figurine::samples
