#include "toolchain/reconstruction/reconstruction.h"

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/reconstruction/idle_channels.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"

namespace figurine::reconstruction {

using measure::Box;
using measure::compare_outlines;
using measure::count_filled;
using measure::crop_error;
using measure::difference_error;
using measure::Filled;
using measure::FlatColour;
using measure::foreground_error;
using measure::high_pass;
using measure::HighPass;
using measure::Outline;
using measure::Picture;
using measure::SquaredError;
using pictures::head_joints;
using pictures::left_hand_joints;
using pictures::pose_frame;
using pictures::PosedFrame;
using pictures::projected_box;
using pictures::render_picture;
using pictures::true_picture;

namespace {

// The wardrobe's hair rises by up to 14 % of the head's height over the skin that the box is drawn
// around; wider, it would take in collars (docs/numerics.md, "Picture quality").
constexpr float kHeadEnlarge = 0.15f;

struct Group {
  SquaredError foreground, crop, head, hand;
  HighPass sharpness, head_sharpness;
  Outline outline;
  Filled filled;
  FlatColour flat;
  uint64_t images = 0;

  void add(const Picture& prediction, const Picture& truth, const Box& head_box,
           const Box& hand_box) {
    foreground.add(foreground_error(prediction, truth));
    crop.add(crop_error(prediction, truth));
    sharpness.add(high_pass(prediction, truth));
    if (!head_box.empty()) {
      head.add(foreground_error(prediction, truth, head_box));
      head_sharpness.add(high_pass(prediction, truth, head_box));
    }
    if (!hand_box.empty()) hand.add(foreground_error(prediction, truth, hand_box));
    outline.add(compare_outlines(prediction, truth));
    filled.add(count_filled(prediction, truth));
    flat.add(truth);
    ++images;
  }
};

// JSON has no infinity and no NaN: equal pictures and absent pixels become null.
nlohmann::json to_json(const Group& group) {
  return {{"images", group.images},
          {"psnr_db", finite(group.foreground.psnr_db())},
          {"flat_psnr_db", finite(group.flat.error().psnr_db())},
          {"crop_psnr_db", finite(group.crop.psnr_db())},
          {"head_psnr_db", finite(group.head.psnr_db())},
          {"hand_psnr_db", finite(group.hand.psnr_db())},
          {"highpass_ratio", finite(group.sharpness.ratio())},
          {"highpass_correlation", finite(group.sharpness.correlation())},
          {"head_highpass_ratio", finite(group.head_sharpness.ratio())},
          {"head_highpass_correlation", finite(group.head_sharpness.correlation())},
          {"filled_share", finite(group.filled.share())},
          {"mask_iou", group.outline.iou()},
          {"uncovered_share", group.outline.uncovered_share()}};
}

// Images of the same role, told apart by how much of the person they hold.
struct Framed {
  Group body, bust;
  Group& of(dataset::Framing framing) { return framing == dataset::Framing::kBust ? bust : body; }
};

// The same figures of close-ups have "bust_" before their names; none where there are no such
// images.
nlohmann::json to_json(const Framed& framed) {
  nlohmann::json report = to_json(framed.body);
  if (framed.bust.images == 0) return report;
  const nlohmann::json bust = to_json(framed.bust);
  for (const auto& [name, value] : bust.items()) report["bust_" + name] = value;
  return report;
}

// The groups that an image of this role counts for.
std::vector<std::string> groups_of(dataset::Role role) {
  switch (role) {
    case dataset::Role::kTrain:
      return {};
    case dataset::Role::kHeldOutView:
      return {"held_out_views"};
    case dataset::Role::kHeldOutPoseInterleaved:
      return {"held_out_poses", "held_out_poses_interleaved"};
    case dataset::Role::kHeldOutPoseBlock:
      return {"held_out_poses", "held_out_poses_block"};
    case dataset::Role::kHeldOutViewAndPose:
      return {"held_out_views_and_poses"};
  }
  return {};
}

}  // namespace

nlohmann::json evaluate_reconstruction(train::TrainedAvatar& avatar,
                                       const ReconstructionOptions& options) {
  const dataset::Dataset& data = avatar.data();
  const size_t cameras = data.cameras().size(), frames = data.frames().size();
  std::map<std::string, Framed> groups;
  SquaredError difference;
  // Per camera the picture of the block frame before, for the frame differences.
  struct Before {
    size_t frame = 0;
    Picture prediction, truth;
  };
  std::vector<std::optional<Before>> before(cameras);
  train::Progress progress("evaluate", options.quiet);
  const train::InterruptGuard interrupt;
  size_t training_frames = 0;
  std::optional<IdleChannels> idle;
  if (avatar.model().has_network()) idle.emplace(avatar.model().unet());
  for (size_t frame = 0; frame < frames; ++frame) {
    const dataset::FrameSplit split = data.frames()[frame].split;
    if (split == dataset::FrameSplit::kTrain && training_frames++ % options.view_frame_step != 0)
      continue;
    std::optional<PosedFrame> posed;
    for (size_t camera = 0; camera < cameras; ++camera) {
      const dataset::Role role = data.role(frame, camera);
      if (role == dataset::Role::kTrain || role == dataset::Role::kMissing) continue;
      if (interrupt.requested()) throw train::Interrupted("evaluate: stopped; nothing was written");
      if (!posed) {
        posed = pose_frame(avatar, frame);
        if (idle) idle->look_at(posed->posed.input);
      }
      const Camera& view = data.cameras()[camera].camera;
      const dataset::Framing framing = data.cameras()[camera].framing;
      const Picture prediction = render_picture(avatar, *posed, view);
      const Picture truth = true_picture(data, frame, camera);
      const Box head_box =
          projected_box(avatar.model(), posed->posed, view, head_joints(), kHeadEnlarge);
      const Box hand_box = projected_box(avatar.model(), posed->posed, view, left_hand_joints(), 0);
      for (const std::string& group : groups_of(role))
        groups[group].of(framing).add(prediction, truth, head_box, hand_box);
      if (split == dataset::FrameSplit::kBlock && framing == dataset::Framing::kBody) {
        std::optional<Before>& last = before[camera];
        if (last && last->frame + 1 == frame)
          difference.add(difference_error(last->prediction, prediction, last->truth, truth));
        last = Before{frame, prediction, truth};
      }
    }
    progress.show(double(frame + 1) / double(frames),
                  "frame " + std::to_string(frame + 1) + " of " + std::to_string(frames));
  }
  if (groups.empty())
    throw InputError(data.directory() + ": nothing is held out, so there is nothing to evaluate");
  nlohmann::json report = nlohmann::json::object();
  for (const char* name : {"held_out_views", "held_out_poses", "held_out_poses_interleaved",
                           "held_out_poses_block", "held_out_views_and_poses"}) {
    report[name] = to_json(groups[name]);
  }
  report["parts"] = train::describe_parts(avatar.model());
  if (idle) {
    report["rectified_channels"] = idle->channels();
    report["idle_channels"] = idle->idle();
  }
  report["difference_psnr_db"] = finite(difference.psnr_db());
  report["definition"] =
      "PSNR over pixels whose true alpha exceeds 0.5, on stored sRGB values, over mid-grey, pooled "
      "MSE; flat: one colour with a perfect "
      "mask; crop: bounding box "
      "of the mask, over black; head: projected box of the head's texels, 15 % larger; hand: of "
      "the left hand's; high-pass: "
      "energy of (picture - 3x3 mean) "
      "inside the mask, "
      "prediction over truth, and its correlation with the truth's; filled: alpha of at least 0.98 "
      "where the truth has it, 3 pixels inside the mask; bust: the same of the cameras of head and "
      "shoulders, which count nowhere else; difference: PSNR of consecutive frames' differences in "
      "the held-out "
      "block";
  return report;
}

}  // namespace figurine::reconstruction
