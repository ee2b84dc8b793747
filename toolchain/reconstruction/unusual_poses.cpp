#include "toolchain/reconstruction/unusual_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "figurine/detail/philox.h"
#include "figurine/known_poses.h"
#include "ports/motion/clip.h"
#include "toolchain/capture/retake.h"
#include "toolchain/capture/sequence.h"
#include "toolchain/dataset/picture_file.h"
#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/measure/resized.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/reconstruction/retaken.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/known_poses.h"
#include "toolchain/train/progress.h"

namespace figurine::reconstruction {

using measure::HighPass;
using measure::Outline;
using measure::Picture;
using measure::SquaredError;

namespace {

constexpr double kStretches[] = {1.5, 2, 3};
constexpr double kRandomTurns_rad[] = {0.2, 0.4, 0.8, 1.6};
constexpr uint64_t kRandomSeed = 1;
constexpr uint32_t kBodyJoints = 22;  // SMPL-X: the root, then joints without hands and face
constexpr uint32_t kTileHeight_px = 240;

using Frame = dataset::CaptureFrame;

struct PoseSet {
  std::string name;
  std::vector<Frame> frames;
};

std::vector<Frame> spread(const std::vector<Frame>& all, uint32_t count) {
  std::vector<Frame> chosen;
  const size_t n = std::min<size_t>(count, all.size());
  for (size_t i = 0; i < n; ++i) chosen.push_back(all[i * all.size() / n]);
  return chosen;
}

// Hamilton's product, wxyz.
std::array<double, 4> product(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

std::array<double, 4> quaternion_of(const std::array<double, 3>& vector) {
  const double angle = std::hypot(vector[0], vector[1], vector[2]);
  const double factor = angle < 1e-9 ? 0.5 : std::sin(angle / 2) / angle;
  return {std::cos(angle / 2), factor * vector[0], factor * vector[1], factor * vector[2]};
}

// Every joint of the body but the root, changed.
template <class Change>
Frame changed(Frame frame, const Change& change) {
  const uint32_t joints = std::min(kBodyJoints, static_cast<uint32_t>(frame.rotations.size() / 4));
  for (uint32_t joint = 1; joint < joints; ++joint) {
    float* const q = &frame.rotations[size_t{4} * joint];
    const std::array<double, 4> to = change(joint, q);
    for (size_t k = 0; k < 4; ++k) q[k] = static_cast<float>(to[k]);
  }
  return frame;
}

Frame stretched(const Frame& frame, double factor) {
  return changed(frame, [&](uint32_t, const float* q) {
    std::array<double, 3> vector = rotation_vector(q);
    for (double& value : vector) value *= factor;
    return quaternion_of(vector);
  });
}

Frame shaken(const Frame& frame, double deviation_rad, uint64_t number) {
  return changed(frame, [&](uint32_t joint, const float* q) {
    const std::array<double, 4> normal = stream_normals(kRandomSeed, number, joint);
    const double each = deviation_rad / std::sqrt(3.0);
    return product({q[0], q[1], q[2], q[3]},
                   quaternion_of({each * normal[0], each * normal[1], each * normal[2]}));
  });
}

std::vector<PoseSet> make_sets(const train::TrainedAvatar& avatar,
                               const UnusualPosesOptions& options) {
  std::vector<Frame> training, held_out;
  for (const Frame& frame : avatar.data().frames())
    (frame.split == dataset::FrameSplit::kTrain ? training : held_out).push_back(frame);
  if (training.empty() || held_out.empty())
    throw InputError(avatar.data().directory() + ": no pose is held out, or none is trained on");
  std::vector<PoseSet> sets{{"trained", spread(training, options.poses)},
                            {"held out", spread(held_out, options.poses)}};
  const auto add = [&](const std::string& name, const auto& change) {
    PoseSet& set = sets.emplace_back(PoseSet{name, {}});
    for (size_t i = 0; i < sets[0].frames.size(); ++i)
      set.frames.push_back(change(sets[0].frames[i], i));
  };
  for (const double factor : kStretches) {
    char name[32];
    std::snprintf(name, sizeof name, "angles x %g", factor);
    add(name, [&](const Frame& frame, size_t) { return stretched(frame, factor); });
  }
  for (const double deviation : kRandomTurns_rad) {
    char name[32];
    std::snprintf(name, sizeof name, "random turns of %g rad", deviation);
    add(name, [&](const Frame& frame, size_t i) { return shaken(frame, deviation, i); });
  }
  const Body& body = avatar.body();
  std::vector<float> joints(body.joint_position_m.size()), texels(body.texel_position_m.size());
  shape_body(body, avatar.data().shape(), joints, texels);
  for (const std::string& path : options.motions) {
    const std::string name = std::filesystem::path(path).stem().string();
    const ports::MotionClip clip =
        value_or_throw(ports::read_clip(path, body, {.name = name}, nullptr));
    PoseSet& set = sets.emplace_back(PoseSet{"motion " + name, {}});
    for (const capture::CapturedPose& captured :
         capture::make_sequence({clip}, {.frames = std::min(options.poses, clip.frame_count),
                                         .root_rest_m = {joints[0], joints[1], joints[2]}})) {
      set.frames.push_back({.root_translation_m = captured.pose.root_translation_m,
                            .rotations = captured.pose.rotations});
    }
  }
  return sets;
}

// Pictures of one kind: of the network shown one pose or another.
struct Errors {
  SquaredError foreground;
  HighPass sharpness;
  Outline outline;

  void add(const Picture& prediction, const Picture& truth) {
    foreground.add(measure::foreground_error(prediction, truth));
    sharpness.add(measure::high_pass(prediction, truth));
    outline.add(measure::compare_outlines(prediction, truth));
  }
  void add(const Errors& other) {
    foreground.add(other.foreground), sharpness.add(other.sharpness), outline.add(other.outline);
  }
  nlohmann::json json() const {
    return {{"psnr_db", finite(foreground.psnr_db())},
            {"highpass_ratio", finite(sharpness.ratio())},
            {"highpass_correlation", finite(sharpness.correlation())},
            {"mask_iou", outline.iou()}};
  }
};

// Of one pose, or of a set.
struct Seen {
  Errors as_it_is, kept;
  std::vector<Errors> by_share;  // of options.shares
  void add(const Seen& other) {
    as_it_is.add(other.as_it_is), kept.add(other.kept);
    by_share.resize(other.by_share.size());
    for (size_t i = 0; i < by_share.size(); ++i) by_share[i].add(other.by_share[i]);
  }
};

struct MostUnusual {
  double distance = -1;
  Picture truth, as_it_is, kept;
};

class Study {
 public:
  Study(train::TrainedAvatar& avatar, const UnusualPosesOptions& options)
      : avatar_(avatar),
        options_(options),
        truth_(avatar.data().directory(), avatar.body_file().package, options.makehuman),
        cameras_(choose_cameras(avatar.data(), dataset::Framing::kBody, options.views)) {
    std::vector<std::vector<float>> poses;
    for (const Frame& frame : avatar.data().frames()) {
      if (frame.split == dataset::FrameSplit::kTrain) poses.push_back(frame.rotations);
    }
    const train::KnownPoseStatistics statistics =
        train::known_poses(poses, avatar.body().joint_count());
    known_ = value_or_throw(KnownPoses::create(statistics.view()), "training poses");
    distances_ = statistics.distances;
  }

  nlohmann::json run() {
    const std::vector<PoseSet> sets = make_sets(avatar_, options_);
    size_t total = 0, done = 0;
    for (const PoseSet& set : sets) total += set.frames.size();
    train::Progress progress("poses", options_.quiet);
    const train::InterruptGuard interrupt;
    nlohmann::json rows = nlohmann::json::array(), poses = nlohmann::json::array();
    std::vector<MostUnusual> pictures;
    for (const PoseSet& set : sets) {
      Seen together;
      std::vector<double> distances;
      size_t pulled_poses = 0, beyond_all = 0;
      MostUnusual& most = pictures.emplace_back();
      for (const Frame& frame : set.frames) {
        if (interrupt.requested())
          throw train::Interrupted("evaluate: stopped; nothing was written");
        const PoseRarity rarity = known_.rarity(frame.rotations);
        Frame pulled = frame;
        const bool is_pulled = known_.pull(frame.rotations, pulled.rotations);
        const Seen seen = look(frame, pulled, rarity.distance, most);
        together.add(seen);
        distances.push_back(rarity.distance);
        pulled_poses += is_pulled ? 1 : 0;
        beyond_all += rarity.share_beyond == 0 ? 1 : 0;
        poses.push_back({{"set", set.name},
                         {"distance", rarity.distance},
                         {"share_beyond", rarity.share_beyond},
                         {"as_it_is_psnr_db", finite(seen.as_it_is.foreground.psnr_db())},
                         {"kept_psnr_db", finite(seen.kept.foreground.psnr_db())}});
        progress.show(double(++done) / double(total), set.name);
      }
      std::sort(distances.begin(), distances.end());
      nlohmann::json by_share = nlohmann::json::array();
      for (size_t i = 0; i < options_.shares.size(); ++i) {
        nlohmann::json row = together.by_share[i].json();
        row["share"] = options_.shares[i];
        by_share.push_back(std::move(row));
      }
      rows.push_back({{"name", set.name},
                      {"poses", set.frames.size()},
                      {"images", set.frames.size() * cameras_.size()},
                      {"distance",
                       {{"min", distances.front()},
                        {"median", distances[distances.size() / 2]},
                        {"max", distances.back()}}},
                      {"pulled", pulled_poses},
                      {"beyond_all", beyond_all},
                      {"as_it_is", together.as_it_is.json()},
                      {"kept", together.kept.json()},
                      {"by_share", by_share}});
    }
    if (!options_.sheet.empty()) write_sheet(pictures);
    return {{"training_distances",
             {{"min", distances_.front()},
              {"median", distances_[distances_.size() / 2]},
              {"knee", known_.distance_beyond(1 - kKnownShare)},
              {"max", distances_.back()}}},
            {"sets", rows},
            {"poses", poses},
            {"definition",
             "the person photographed again in every pose, from cameras of whole bodies; PSNR over "
             "pixels whose true alpha exceeds 0.5, over mid-grey, pooled; as_it_is: the network is "
             "shown the pose, kept: what it is shown under keep_to_known, by_share: the mean "
             "training pose and that share of the deviation from it; skinning has the true pose; "
             "pulled, beyond_all: how many poses were pulled, and are farther out than all "
             "training poses"}};
  }

 private:
  Seen look(const Frame& frame, const Frame& pulled, double distance, MostUnusual& most) {
    train::AvatarModel& model = avatar_.model();
    truth_.set_pose(frame.pose());
    pictures::PosedFrame posed{model.pose(model.from_capture(frame).view()), {}};
    const auto shown = [&](const Frame& shown_frame) {
      return model.evaluate(model.pose(model.from_capture(shown_frame).view()));
    };
    const torch::Tensor as_it_is = shown(frame), kept = shown(pulled);
    std::vector<torch::Tensor> by_share;
    for (const double share : options_.shares) {
      Frame moved = frame;
      known_.move_to_mean(frame.rotations, share, moved.rotations);
      by_share.push_back(shown(moved));
    }
    Seen seen{.as_it_is = {}, .kept = {}, .by_share = std::vector<Errors>(by_share.size())};
    for (size_t c = 0; c < cameras_.size(); ++c) {
      const Camera& camera = avatar_.data().cameras()[cameras_[c]].camera;
      const Picture truth = picture_of(truth_.render(camera));
      const auto draw = [&](const torch::Tensor& head) {
        posed.head = head;
        return pictures::render_picture(avatar_, posed, camera);
      };
      const Picture plain = draw(as_it_is), nearer = draw(kept);
      seen.as_it_is.add(plain, truth);
      seen.kept.add(nearer, truth);
      for (size_t i = 0; i < by_share.size(); ++i) seen.by_share[i].add(draw(by_share[i]), truth);
      if (c == 0 && distance > most.distance) most = {distance, truth, plain, nearer};
    }
    return seen;
  }

  // A row a set: truth, the pose as it is, kept to what is known; over grey.
  void write_sheet(const std::vector<MostUnusual>& rows) const {
    const Picture& first = rows.front().truth;
    const uint32_t height = std::min(kTileHeight_px, first.height_px),
                   width = std::max(1u, first.width_px * height / first.height_px);
    const uint32_t columns = 2;  // of three pictures each
    const uint32_t lines = (static_cast<uint32_t>(rows.size()) + columns - 1) / columns;
    ports::ImageU8 sheet(3 * width * columns, height * lines, 3);
    std::fill(sheet.pixels.begin(), sheet.pixels.end(), uint8_t{127});
    for (size_t row = 0; row < rows.size(); ++row) {
      const Picture* pictures[] = {&rows[row].truth, &rows[row].as_it_is, &rows[row].kept};
      for (uint32_t column = 0; column < 3; ++column) {
        const Picture tile = measure::resized(*pictures[column], width, height);
        const uint32_t x0 = (3 * static_cast<uint32_t>(row % columns) + column) * width,
                       y0 = static_cast<uint32_t>(row / columns) * height;
        for (uint32_t y = 0; y < height; ++y) {
          for (uint32_t x = 0; x < width; ++x) {
            const uint8_t* rgba = &tile.rgba[(size_t(y) * width + x) * 4];
            for (int c = 0; c < 3; ++c)
              sheet.at(x0 + x, y0 + y)[c] =
                  static_cast<uint8_t>(std::min(255, rgba[c] + (255 - rgba[3]) / 2));
          }
        }
      }
    }
    dataset::write_picture(options_.sheet, sheet);
  }

  train::TrainedAvatar& avatar_;
  const UnusualPosesOptions& options_;
  capture::Retake truth_;
  std::vector<size_t> cameras_;
  KnownPoses known_;
  std::vector<float> distances_;
};

}  // namespace

nlohmann::json evaluate_unusual_poses(train::TrainedAvatar& avatar,
                                      const UnusualPosesOptions& options) {
  check_retakable(avatar.data());
  if (!avatar.model().has_network())
    throw InputError(avatar.data().directory() + ": the avatar has no network to be shown poses");
  if (!options.sheet.empty()) dataset::check_picture_name(options.sheet);
  return Study(avatar, options).run();
}

}  // namespace figurine::reconstruction
