#include "ports/motion/smpl.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "ports/motion/clip_tree.h"
#include "ports/motion/npz.h"
#include "ports/motion/standing.h"

namespace figurine::ports {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMaxValue = 1e4;
constexpr uint32_t kBodyJoints = kJaw;  // 22
constexpr uint32_t kFaceJoints = 3;     // jaw and eyes
constexpr uint32_t kHandJoints = 30;

// Rotations of some joints in a row, [F, joints, 3] axis-angle or [F, joints, 9] matrices.
struct Rotations {
  std::string name;  // of the array
  NpyArray array;
  size_t frames = 0, joints = 0;
  bool matrices = false;

  Quat at(size_t frame, size_t joint) const {
    const double* value = &array.values[(frame * joints + joint) * (matrices ? 9 : 3)];
    if (matrices) {  // row-major in the file
      const Mat3 m{{value[0], value[3], value[6]},
                   {value[1], value[4], value[7]},
                   {value[2], value[5], value[8]}};
      return unit(quaternion_of(m));
    }
    const Vec3 axis_angle(value[0], value[1], value[2]);
    const double angle = length(axis_angle);
    return angle > 1e-12 ? about(axis_angle / angle, angle) : no_turn();
  }
};

class SmplFile {
 public:
  SmplFile(const NpzFile& file, std::string where) : file_(file), where_(std::move(where)) {}

  std::string where(const std::string& name) const { return where_ + ": " + name; }
  std::string first_of(std::initializer_list<const char*> names) const {
    for (const char* name : names) {
      if (file_.has(name)) return name;
    }
    return "";
  }

  Result<NpyArray> values(const std::string& name) const {
    Result<NpyArray> array = file_.read(name);
    if (!array.ok()) return array;
    // A batch of one.
    while (array->shape.size() > 2 && array->shape[0] == 1)
      array->shape.erase(array->shape.begin());
    for (const double value : array->values) {
      if (!(std::abs(value) <= kMaxValue))
        return corrupt(name, "a value is not finite or out of range");
    }
    return array;
  }

  Result<Rotations> rotations(const std::string& name) const {
    Result<NpyArray> array = values(name);
    if (!array.ok()) return array.status();
    Rotations out;
    out.name = name;
    const std::vector<size_t>& shape = array->shape;
    const size_t last = shape.empty() ? 0 : shape.back();
    if (shape.size() == 4 && shape[2] == 3 && last == 3) {
      out.joints = shape[1];
      out.matrices = true;
    } else if (shape.size() == 3 && shape[1] == 3 && last == 3) {  // a joint's matrices
      out.joints = 1;
      out.matrices = true;
    } else if (shape.size() == 3 && last == 3) {
      out.joints = shape[1];
    } else if (shape.size() == 2 && last % 3 == 0) {
      out.joints = last / 3;
    } else {
      return unsupported(name,
                         "shape " + text_of(shape) + ", expected [F,3 J], [F,J,3] or [F,J,3,3]");
    }
    out.frames = shape[0];
    out.array = std::move(array).value();
    if (out.matrices) FIG_RETURN_IF_ERROR(check_matrices(out));
    return out;
  }

  Status corrupt(const std::string& name, const std::string& reason) const {
    return Status(StatusCode::kCorrupt, where(name) + ": " + reason);
  }
  Status unsupported(const std::string& name, const std::string& reason) const {
    return Status(StatusCode::kUnsupported, where(name) + ": " + reason);
  }
  static std::string text_of(const std::vector<size_t>& shape) {
    std::string text;
    for (const size_t extent : shape) text += (text.empty() ? "(" : ",") + std::to_string(extent);
    return text.empty() ? "()" : text + ")";
  }

 private:
  Status check_matrices(const Rotations& rotations) const {
    const std::vector<double>& v = rotations.array.values;
    for (size_t i = 0; i + 8 < v.size(); i += 9) {
      const Vec3 a(v[i], v[i + 1], v[i + 2]), b(v[i + 3], v[i + 4], v[i + 5]),
          c(v[i + 6], v[i + 7], v[i + 8]);
      const double off = std::max({std::abs(dot(a, b)), std::abs(dot(b, c)), std::abs(dot(a, c)),
                                   std::abs(dot(a, a) - 1), std::abs(dot(b, b) - 1)});
      if (off > 0.02 || dot(cross(a, b), c) < 0.5)
        return corrupt(rotations.name, "matrix " + std::to_string(i / 9) + " is no rotation");
    }
    return {};
  }

  const NpzFile& file_;
  std::string where_;
};

// Which joints a part's rotations are, in their order.
struct Part {
  Rotations rotations;
  std::vector<uint32_t> joints;  // at most as many as there are rotations: the rest is not read
};

std::vector<uint32_t> joints_from(uint32_t first, size_t count) {
  std::vector<uint32_t> out(count);
  for (size_t i = 0; i < count; ++i) out[i] = first + static_cast<uint32_t>(i);
  return out;
}

// All joints in one array: by their number.
Result<std::vector<uint32_t>> joints_of_whole(const SmplFile& file, const Rotations& rotations) {
  switch (rotations.joints) {
    case kBodyJoints:
    case 24:  // SMPL: two hands that no other body has, behind the 22
      return joints_from(0, kBodyJoints);
    case 52: {  // SMPL-H: no jaw and eyes
      std::vector<uint32_t> joints = joints_from(0, kBodyJoints);
      const std::vector<uint32_t> hands = joints_from(kLeftIndex1, kHandJoints);
      joints.insert(joints.end(), hands.begin(), hands.end());
      return joints;
    }
    case kJointCount:
      return joints_from(0, kJointCount);
    default:
      break;
  }
  return file.unsupported(rotations.name,
                          std::to_string(3 * rotations.joints) +
                              " columns, expected 165 (SMPL-X), 156 (SMPL-H), 72 (SMPL) or 66 "
                              "(body), or these as joints");
}

struct Parts {
  std::vector<Part> parts;
  std::string note;

  // count: of rotations that the part must hold, or any of several.
  Status add(const SmplFile& file, const std::string& name, uint32_t first, size_t wanted,
             std::initializer_list<size_t> counts) {
    if (name.empty()) return {};
    Result<Rotations> rotations = file.rotations(name);
    const bool is_hand = first >= kLeftIndex1;
    if (is_hand && (!rotations.ok() ||
                    std::find(counts.begin(), counts.end(), rotations->joints) == counts.end())) {
      note += (note.empty() ? "" : ", ") + name + " are no rotations: hands at rest";
      return {};
    }
    if (!rotations.ok()) return rotations.status();
    if (std::find(counts.begin(), counts.end(), rotations->joints) == counts.end()) {
      return file.unsupported(name, std::to_string(3 * rotations->joints) + " columns, expected " +
                                        std::to_string(3 * wanted));
    }
    parts.push_back({std::move(rotations).value(), joints_from(first, wanted)});
    return {};
  }
};

Result<Parts> parts_of(const SmplFile& file) {
  Parts out;
  const std::string whole = file.first_of(
      {"poses", "fullpose", "full_pose", "full_poses", "smpl_poses", "smplx_poses", "pose"});
  const std::string root =
      file.first_of({"root_orient", "global_orient", "smpl_global_orient", "pose_root"});
  const std::string body = file.first_of({"pose_body", "body_pose", "smpl_body_pose"});
  if (!whole.empty()) {
    Result<Rotations> rotations = file.rotations(whole);
    if (!rotations.ok()) return rotations.status();
    // Some tools call the body alone so.
    const bool body_alone = (rotations->joints == 21 || rotations->joints == 23) && !root.empty();
    if (!body_alone) {
      Result<std::vector<uint32_t>> joints = joints_of_whole(file, *rotations);
      if (!joints.ok()) return joints.status();
      out.parts.push_back({std::move(rotations).value(), std::move(joints).value()});
      return out;
    }
    FIG_RETURN_IF_ERROR(out.add(file, root, kPelvis, 1, {1}));
    FIG_RETURN_IF_ERROR(out.add(file, whole, kLeftHip, 21, {21, 23}));
    return out;
  }
  if (root.empty() || body.empty()) {
    return file.unsupported(
        "poses", std::string("no such array, and no ") +
                     (root.empty() ? "root_orient or global_orient" : "pose_body or body_pose"));
  }
  FIG_RETURN_IF_ERROR(out.add(file, root, kPelvis, 1, {1}));
  FIG_RETURN_IF_ERROR(out.add(file, body, kLeftHip, 21, {21, 23}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"pose_jaw", "jaw_pose"}), kJaw, 1, {1}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"pose_eye", "eye_pose"}), kLeftEye, 2, {2}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"leye_pose"}), kLeftEye, 1, {1}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"reye_pose"}), kRightEye, 1, {1}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"pose_hand", "hand_pose"}), kLeftIndex1,
                              kHandJoints, {kHandJoints}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"left_hand_pose", "pose_lhand", "lhand_pose"}),
                              kLeftIndex1, kHandJoints / 2, {kHandJoints / 2}));
  FIG_RETURN_IF_ERROR(out.add(file, file.first_of({"right_hand_pose", "pose_rhand", "rhand_pose"}),
                              kRightIndex1, kHandJoints / 2, {kHandJoints / 2}));
  return out;
}

Result<double> rate_of(const SmplFile& file, const NpzFile& npz, const RetargetOptions& options) {
  if (options.source_fps) return double{*options.source_fps};
  const std::string name = file.first_of({"mocap_frame_rate", "mocap_framerate", "fps",
                                          "frame_rate", "framerate", "mocap_fps", "video_fps"});
  if (name.empty()) {
    return Status(StatusCode::kInvalidArgument,
                  file.where("mocap_frame_rate") +
                      ": no such array (nor fps, frame_rate, ...); --source-fps gives the rate");
  }
  const Result<NpyArray> rate = npz.read(name);
  if (!rate.ok()) return rate.status();
  if (rate->values.size() != 1 || !(rate->values[0] >= 1 && rate->values[0] <= 1000)) {
    return Status(StatusCode::kCorrupt,
                  file.where(name) + ": not within 1 and 1000; --source-fps gives the rate");
  }
  return rate->values[0];
}

}  // namespace

Result<MotionClip> retarget_smpl(std::span<const std::byte> bytes, const std::string& where,
                                 const figurine::Body& body, const RetargetOptions& options,
                                 RetargetReport* report_out) {
  const Result<NpzFile> npz = NpzFile::open(bytes, where);
  if (!npz.ok()) return npz.status();
  const SmplFile file(*npz, where);
  if (options.neutral && *options.neutral != Neutral::kZeroPose) {
    return Status(StatusCode::kInvalidArgument,
                  where + ": neutral: rotations of zero are SMPL's T-pose; there is no other");
  }
  Result<Parts> read = parts_of(file);
  if (!read.ok()) return read.status();
  const std::vector<Part>& parts = read->parts;
  const size_t frames = parts[0].rotations.frames;
  if (frames == 0 || frames > kMaxClipFrames)
    return file.corrupt(parts[0].rotations.name, "no or too many frames");
  for (const Part& part : parts) {
    if (part.rotations.frames != frames) {
      return file.corrupt(part.rotations.name, std::to_string(part.rotations.frames) + " frames, " +
                                                   parts[0].rotations.name + " has " +
                                                   std::to_string(frames));
    }
  }
  const std::string places = file.first_of(
      {"trans", "transl", "smpl_trans", "translation", "root_trans", "pose_trans", "smplx_trans"});
  NpyArray trans{{frames, 3}, {}};
  if (!places.empty()) {
    Result<NpyArray> array = file.values(places);
    if (!array.ok()) return array.status();
    if (array->shape.size() == 3 && array->shape[1] == 1)
      array->shape.erase(array->shape.begin() + 1);
    if (array->shape != std::vector<size_t>{frames, 3}) {
      return file.corrupt(places, "shape " + SmplFile::text_of(array->shape) + ", expected (" +
                                      std::to_string(frames) + ",3)");
    }
    trans = std::move(array).value();
  }
  trans.values.resize(3 * frames, 0.0);
  const Result<double> rate = rate_of(file, *npz, options);
  if (!rate.ok()) return rate.status();

  RetargetSource source;
  source.where = where;
  source.frames_per_second = *rate;
  source.smooth_s = kCaptureSmoothS;
  source.frames = static_cast<uint32_t>(frames);
  // SMPL-X's template: arms along x, legs of 0.79 m. Bodies that stand in that pose themselves are
  // within the tolerance.
  source.leg = 0.79;
  source.tolerance_rad = 20 * kDegree;
  for (int side = 0; side < 2; ++side) {
    for (int joint : {kLeftShoulder, kLeftElbow, kLeftWrist})
      source.direction[static_cast<size_t>(joint + side)] = Vec3(side == 0 ? 1 : -1, 0, 0);
  }
  // Joints before the first of a part are there: parts come in the order of the joints.
  std::vector<std::pair<uint32_t, std::pair<size_t, size_t>>> driven;  // joint; part, column
  for (size_t p = 0; p < parts.size(); ++p) {
    for (size_t i = 0; i < parts[p].joints.size(); ++i) {
      driven.push_back({parts[p].joints[i], {p, i}});
      source.driven[parts[p].joints[i]] = true;
    }
  }
  std::sort(driven.begin(), driven.end());

  // First in the file's own axes: how the person stands tells which is up.
  source.world_from_neutral.assign(frames * kJointCount, no_turn());
  Stance stance;
  const auto place_of = [&](size_t f) {
    return Vec3(trans.values[3 * f], trans.values[3 * f + 1], trans.values[3 * f + 2]);
  };
  const auto pose = [&](size_t f, const Quat& up) {
    Quat* world = &source.world_from_neutral[f * kJointCount];
    for (const auto& [j, at] : driven) {
      const Quat local = parts[at.first].rotations.at(f, at.second);
      world[j] = product(j == 0 ? up : world[joint_parents()[j]], local);
    }
    return world;
  };
  const Vec3 y(0, 1, 0);
  for (size_t f = 0; f < frames; ++f) {
    const Quat* world = pose(f, no_turn());
    const auto upwards = [&](int joint) { return rotated(world[joint], y); };
    stance.add(
        unit(upwards(kPelvis) + upwards(kSpine2) + upwards(kSpine3)),
        -unit(upwards(kLeftHip) + upwards(kRightHip) + upwards(kLeftKnee) + upwards(kRightKnee)),
        place_of(f));
  }
  std::optional<ClipUp> seen;
  if (!options.up) seen = stance.other_up(ClipUp::kZ, source.leg, false);
  const ClipUp axis = options.up ? *options.up : seen.value_or(ClipUp::kZ);
  const Quat up = world_from_clip(axis);
  for (const std::string& defect :
       {stance.lies(up, source.leg), stance.too_fast(1, double(frames) / *rate)}) {
    if (options.checked && !defect.empty()) {
      return Status(StatusCode::kUnsupported,
                    where + ": " + defect + "; --no-checks writes it all the same");
    }
  }
  for (size_t f = 0; f < frames; ++f) {
    const Quat* world = pose(f, up);
    // trans moves the pelvis; the middle of the hips lies 9 cm below it in SMPL-X's template.
    source.hips.push_back(rotated(up, place_of(f)) + rotated(world[kPelvis], Vec3(0, -0.09, 0)));
  }
  char text[96];
  std::snprintf(text, sizeof text, "%zu frames at %.5g a second, up ", frames, *rate);
  std::string summary = text;
  summary += to_string(axis);
  if (seen) summary += " (as the person stands)";
  summary += ", T-pose and bones of SMPL (" + std::to_string(driven.size()) + " joints)";
  if (places.empty()) summary += "; no trans: stays in its place";
  if (!read->note.empty()) summary += "; " + read->note;
  RetargetReport report;
  Result<MotionClip> clip =
      retarget(std::move(source), body, options, options.start.value_or(0), &report);
  report.summary = summary;
  if (clip.ok() && report_out != nullptr) *report_out = report;
  return clip;
}

}  // namespace figurine::ports
