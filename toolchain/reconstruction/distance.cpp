#include "toolchain/reconstruction/distance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "ports/media/png.h"
#include "toolchain/capture/retake.h"
#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/measure/resized.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/reconstruction/retaken.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"

namespace figurine::reconstruction {

using measure::Filled;
using measure::HighPass;
using measure::Outline;
using measure::Picture;
using measure::SquaredError;

namespace {

// Larger pictures take long and tell little more of a second pose and view.
constexpr double kLargestOfAll = 4;
constexpr double kLatticeScales[] = {2, 4}, kHoleScales[] = {1, 4};
constexpr double kMostHighpass = 1.0, kLeastFilled = 0.999;
constexpr const char* kFramings[] = {"body", "bust"};

// What pictures of one framing at one scale come to.
struct Sight {
  SquaredError foreground, resampled;
  HighPass sharpness;
  Filled filled;
  Outline outline;
  double coverage = 0, true_coverage = 0;  // sums of alpha
  uint64_t images = 0;

  // own: the avatar's picture at the capture's size, brought to this one.
  void add(const Picture& prediction, const Picture& own, const Picture& truth) {
    foreground.add(measure::foreground_error(prediction, truth));
    resampled.add(measure::foreground_error(own, truth));
    sharpness.add(measure::high_pass(prediction, truth));
    filled.add(measure::count_filled(prediction, truth));
    outline.add(measure::compare_outlines(prediction, truth));
    for (size_t i = 3; i < truth.rgba.size(); i += 4) {
      coverage += prediction.rgba[i];
      true_coverage += truth.rgba[i];
    }
    ++images;
  }
};

nlohmann::json to_json(const Sight& group) {
  return {{"images", group.images},
          {"psnr_db", finite(group.foreground.psnr_db())},
          {"resampled_psnr_db", finite(group.resampled.psnr_db())},
          {"highpass_ratio", finite(group.sharpness.ratio())},
          {"highpass_correlation", finite(group.sharpness.correlation())},
          {"filled_share", finite(group.filled.share())},
          {"mask_iou", group.outline.iou()},
          {"coverage_ratio", finite(group.coverage / group.true_coverage)}};
}

Camera scaled(Camera camera, double scale) {
  const auto side = [&](uint32_t& size_px) {
    const double before = size_px;
    size_px = static_cast<uint32_t>(std::max(1.0, std::round(before * scale)));
    return static_cast<float>(size_px / before);
  };
  const float x = side(camera.width_px), y = side(camera.height_px);
  camera.fx_px *= x, camera.cx_px *= x;
  camera.fy_px *= y, camera.cy_px *= y;
  return camera;
}

std::vector<size_t> choose_frames(const dataset::Dataset& data, uint32_t count) {
  std::vector<size_t> held_out, chosen;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    if (data.frames()[frame].split != dataset::FrameSplit::kTrain) held_out.push_back(frame);
  }
  if (held_out.empty())
    throw InputError(data.directory() + ": no pose is held out, so there is nothing to evaluate");
  const size_t n = std::min<size_t>(count, held_out.size());
  for (size_t i = 0; i < n; ++i) chosen.push_back(held_out[i * held_out.size() / n]);
  return chosen;
}

// Both side by side over grey, the truth left.
void write_pair(const std::string& path, const Picture& truth, const Picture& prediction) {
  ports::ImageU8 pair(2 * truth.width_px, truth.height_px, 3);
  for (uint32_t y = 0; y < truth.height_px; ++y) {
    for (uint32_t x = 0; x < 2 * truth.width_px; ++x) {
      const bool left = x < truth.width_px;
      const Picture& from = left ? truth : prediction;
      const uint8_t* rgba =
          &from.rgba[(size_t(y) * truth.width_px + (left ? x : x - truth.width_px)) * 4];
      for (int c = 0; c < 3; ++c)
        pair.at(x, y)[c] = static_cast<uint8_t>(std::min(255, rgba[c] + (255 - rgba[3]) / 2));
    }
  }
  throw_if_error(ports::write_file_atomically(path, value_or_throw(ports::encode_png(pair), path)),
                 "cannot save");
}

// One avatar, its person and what is asked of both.
class Comparison {
 public:
  Comparison(train::TrainedAvatar& avatar, const DistanceOptions& options)
      : avatar_(avatar),
        options_(options),
        truth_(avatar.data().directory(), avatar.body_file().package, options.makehuman),
        scales_(options.scales) {
    scales_.push_back(1);
    std::sort(scales_.begin(), scales_.end());
    scales_.erase(std::unique(scales_.begin(), scales_.end()), scales_.end());
    const dataset::Framing framings[] = {dataset::Framing::kBody, dataset::Framing::kBust};
    for (size_t f = 0; f < std::size(framings); ++f)
      cameras_[kFramings[f]] = choose_cameras(avatar.data(), framings[f], options.views);
  }

  nlohmann::json run() {
    const std::vector<size_t> frames = choose_frames(avatar_.data(), options_.poses);
    train::Progress progress("distance", options_.quiet);
    const train::InterruptGuard interrupt;
    for (size_t i = 0; i < frames.size(); ++i) {
      const pictures::PosedFrame posed = pictures::pose_frame(avatar_, frames[i]);
      truth_.set_pose(avatar_.data().frames()[frames[i]].pose());
      for (const auto& [framing, cameras] : cameras_) {
        for (size_t c = 0; c < cameras.size(); ++c) {
          if (interrupt.requested())
            throw train::Interrupted("evaluate: stopped; nothing was written");
          compare(posed, framing, avatar_.data().cameras()[cameras[c]].camera, i == 0 && c == 0);
        }
      }
      progress.show(double(i + 1) / double(frames.size()),
                    "pose " + std::to_string(i + 1) + " of " + std::to_string(frames.size()));
    }
    return report();
  }

 private:
  void compare(const pictures::PosedFrame& posed, const std::string& framing, const Camera& camera,
               bool first) {
    const Picture own = pictures::render_picture(avatar_, posed, camera);
    for (const double scale : scales_) {
      if (scale > kLargestOfAll && !first) continue;
      const Camera seen = scaled(camera, scale);
      const Picture prediction = pictures::render_picture(avatar_, posed, seen),
                    truth = picture_of(truth_.render(seen));
      groups_[{scale, framing}].add(prediction,
                                    measure::resized(own, seen.width_px, seen.height_px), truth);
      if (first && !options_.pictures.empty()) {
        char name[64];
        std::snprintf(name, sizeof name, "/%g_%s.png", scale, framing.c_str());
        write_pair(options_.pictures + name, truth, prediction);
      }
    }
  }

  const Sight* find(double scale, const std::string& framing) const {
    const auto found = groups_.find({scale, framing});
    return found == groups_.end() || found->second.images == 0 ? nullptr : &found->second;
  }

  nlohmann::json report() const {
    nlohmann::json scales = nlohmann::json::array(), lattice = nlohmann::json::array(),
                   holes = nlohmann::json::array();
    for (const double scale : scales_) {
      nlohmann::json row{{"scale", scale}};
      for (const char* framing : kFramings) {
        const Sight* group = find(scale, framing);
        row[framing] = group == nullptr ? nlohmann::json(nullptr) : to_json(*group);
      }
      scales.push_back(std::move(row));
    }
    for (const char* framing : kFramings) {
      for (const double scale : kLatticeScales) {
        const Sight* group = find(scale, framing);
        if (group == nullptr) continue;
        const double ratio = group->sharpness.ratio(), psnr = group->foreground.psnr_db(),
                     least = group->resampled.psnr_db();
        lattice.push_back({{"scale", scale},
                           {"framing", framing},
                           {"highpass_ratio", finite(ratio)},
                           {"psnr_db", finite(psnr)},
                           {"enlarged_psnr_db", finite(least)},
                           {"passed", ratio <= kMostHighpass && psnr >= least}});
      }
      for (const double scale : kHoleScales) {
        const Sight* group = find(scale, framing);
        if (group == nullptr) continue;
        const double share = group->filled.share();
        holes.push_back({{"scale", scale},
                         {"framing", framing},
                         {"filled_share", finite(share)},
                         {"passed", share >= kLeastFilled}});
      }
    }
    const auto passed = [](const nlohmann::json& rows) {
      return !rows.empty() && std::all_of(rows.begin(), rows.end(), [](const nlohmann::json& row) {
        return row.at("passed").get<bool>();
      });
    };
    return {
        {"scales", scales},
        {"lattice",
         {{"most_highpass_ratio", kMostHighpass}, {"passed", passed(lattice)}, {"rows", lattice}}},
        {"holes",
         {{"least_filled_share", kLeastFilled}, {"passed", passed(holes)}, {"rows", holes}}},
        {"parts", train::describe_parts(avatar_.model())},
        {"definition",
         "views of the capture at another size, same poses and perspective, against the person "
         "photographed again; PSNR over pixels whose true alpha exceeds 0.5, over mid-grey, "
         "pooled; resampled: the avatar's picture at scale 1 brought to this size, bilinear "
         "where it grows, means where it shrinks; high-pass and filled as in evaluate "
         "reconstruction; coverage: sum of alpha, prediction over truth; above scale 4 one "
         "pose and view of each framing"}};
  }

  train::TrainedAvatar& avatar_;
  const DistanceOptions& options_;
  capture::Retake truth_;
  std::vector<double> scales_;
  std::map<std::string, std::vector<size_t>> cameras_;  // by framing
  std::map<std::pair<double, std::string>, Sight> groups_;
};

}  // namespace

nlohmann::json evaluate_distance(train::TrainedAvatar& avatar, const DistanceOptions& options) {
  check_retakable(avatar.data());
  return Comparison(avatar, options).run();
}

}  // namespace figurine::reconstruction
