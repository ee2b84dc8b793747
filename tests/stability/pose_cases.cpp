// Poses and networks far from anything trained, through packages and the whole renderer: twists,
// rotations that are none, heads that overflow. The body is the five texels of docs/numerics.md,
// whose every step can be followed in double.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "figurine/known_poses.h"
#include "tests/golden/posing/five_texels_packages.h"
#include "tests/stability/pose_oracle.h"
#include "tests/stability/scene.h"

namespace figurine::stability {
namespace pose {
namespace {

using golden::FiveTexels;
using golden::FiveTexelsPackages;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

class Stage {  // the example's avatar on a renderer; example may be changed before
 public:
  explicit Stage(const FiveTexels& example)
      : packages_(example), renderer_(std::move(Renderer::create({})).value()) {
    avatar_ = renderer_->add_avatar(packages_.avatar(), packages_.body()).value();
  }
  Result<GaussianView> pose(const PoseView& pose) { return renderer_->pose_avatar(avatar_, pose); }
  Status draw(const PoseView& pose, const Camera& camera, std::vector<float>& rgba) {
    rgba.resize(size_t(camera.width_px) * camera.height_px * 4);
    const FrameAvatar seen[] = {{.avatar = avatar_, .pose = pose}};
    return renderer_->render(
        {.camera = camera, .avatars = seen, .gaussians = {}, .background = {}, .splat = {}},
        {.pixels = rgba.data(),
         .stride_bytes = 16 * size_t(camera.width_px),
         .format = PixelFormat::kRgbaF32});
  }

 private:
  FiveTexelsPackages packages_;
  std::unique_ptr<Renderer> renderer_;
  AvatarId avatar_{};
};

size_t not_finite(const GaussianView& view) {
  return count_not_finite(view.position_m) + count_not_finite(view.covariance_factor) +
         count_not_finite(view.opacity) + count_not_finite(view.sh);
}

// Largest difference from the double pipeline: centres in metres, factors in shares of the largest
// entry of a sound Gaussian (spacing times e^4 at most).
struct PoseError {
  double centre_m = 0, factor = 0;
  size_t not_finite = 0;
  void add(const FiveTexels& example, const GaussianView& view, const PoseView& pose) {
    not_finite += pose::not_finite(view);
    const std::vector<Gaussian64> expected = pose_five_texels(example, pose);
    for (size_t i = 0; i < expected.size(); ++i) {
      double size = 0;
      for (double value : expected[i].factor) size = std::max(size, std::abs(value));
      for (size_t k = 0; k < 3; ++k)
        centre_m =
            std::max(centre_m, std::abs(view.position_m[3 * i + k] - expected[i].centre_m[k]));
      for (size_t k = 0; k < 9; ++k)
        factor = std::max(
            factor, std::abs(view.covariance_factor[9 * i + k] - expected[i].factor[k]) / size);
    }
  }
};

Rows twists() {
  FiveTexels example;
  Stage stage(example);
  PoseError error;
  std::vector<float> rgba;
  size_t pixels_not_finite = 0;
  // Joint 1 turned by 180 degrees and 1e-6 to 1e-2 radians around it, about each axis: texels 1, 2
  // and 3 blend opposite rotations.
  for (int axis = 0; axis < 3; ++axis) {
    for (double off : {0.0, 1e-6, -1e-6, 1e-4, 1e-2}) {
      for (size_t j = 0; j < 3; ++j) {
        float* q = &example.rotations[4 * j];
        std::fill(q, q + 4, 0.0f);
        q[0] = j == 1 ? static_cast<float>(std::sin(off)) : 1.0f;
        if (j == 1) q[1 + axis] = static_cast<float>(std::cos(off));
      }
      const Result<GaussianView> view = stage.pose(example.pose);
      if (!view.ok()) return {{"180-degree twists", view.status().message(), Bound::kAtMost, 0, 1}};
      error.add(example, *view, example.pose);
      if (!stage.draw(example.pose, example.camera, rgba).ok()) ++pixels_not_finite;
      pixels_not_finite += count_not_finite(rgba);
    }
  }
  return {
      {"180-degree twists", "values of Gaussians that are not finite", Bound::kAtMost, 0,
       double(error.not_finite)},
      {"180-degree twists", "pixel values that are not finite", Bound::kAtMost, 0,
       double(pixels_not_finite)},
      {"180-degree twists", "largest error of a centre against float64 [m]", Bound::kAtMost, 2e-6,
       error.centre_m},
      {"180-degree twists", "largest error of a factor against float64, share of its largest entry",
       Bound::kAtMost, 5e-6, error.factor}};
}

Rows rotations_that_are_none() {
  FiveTexels example;
  Stage stage(example);
  std::vector<float> rgba, before;
  if (!stage.draw(example.pose, example.camera, rgba).ok()) return {};
  before = rgba;
  const std::vector<float> sound = example.rotations;
  size_t accepted = 0;
  for (size_t joint = 0; joint < 3; ++joint) {
    for (const std::array<float, 4>& bad : {std::array<float, 4>{0, 0, 0, 0},
                                            {1e-7f, 0, 0, 0},
                                            {kNan, 0, 0, 0},
                                            {1, 0, kNan, 0},
                                            {kInfinity, 0, 0, 1},
                                            {1e20f, 0, 0, 0},
                                            {0, 0, 0, -kInfinity}}) {
      example.rotations = sound;
      std::copy(bad.begin(), bad.end(), &example.rotations[4 * joint]);
      example.pose.rotations = example.rotations;
      if (stage.draw(example.pose, example.camera, rgba).code() != StatusCode::kInvalidArgument)
        ++accepted;
    }
  }
  return {{"21 poses with a zero, NaN or infinite quaternion", "poses not refused", Bound::kAtMost,
           0, double(accepted)},
          {"21 poses with a zero, NaN or infinite quaternion",
           "pixel values changed by a refused frame", Bound::kAtMost, 0,
           double(count_different(before, rgba))}};
}

Rows far_poses() {
  FiveTexels example;
  Stage stage(example);
  Random random(6);
  PoseError error;
  for (int i = 0; i < 2000; ++i) {  // any rotation of any joint, quaternions of any accepted length
    const double length = std::pow(10.0, random.uniform(-5, 14));
    for (size_t j = 0; j < 3; ++j) {
      const std::array<float, 4> q = random.quaternion();
      for (size_t k = 0; k < 4; ++k)
        example.rotations[4 * j + k] = static_cast<float>(q[k] * length);
    }
    const Result<GaussianView> view = stage.pose(example.pose);
    if (!view.ok()) return {{"2,000 random poses", view.status().message(), Bound::kAtMost, 0, 1}};
    error.add(example, *view, example.pose);
  }
  Rows rows{{"2,000 random poses of every joint", "values of Gaussians that are not finite",
             Bound::kAtMost, 0, double(error.not_finite)},
            {"2,000 random poses of every joint", "largest error of a centre against float64 [m]",
             Bound::kAtMost, 3e-6, error.centre_m},
            {"2,000 random poses of every joint",
             "largest error of a factor against float64, share of its largest entry",
             Bound::kAtMost, 1e-5, error.factor}};
  example.rotations = golden::flatten<float>(example.document["pose"]["rotations"]);
  example.pose.rotations = example.rotations;
  for (const auto& [distance, limit] : {std::pair<float, double>{1000, 2.5e-4}, {1e6f, 0.25}}) {
    PoseError far;
    example.pose.root_translation_m = {distance, -distance, distance};
    const Result<GaussianView> view = stage.pose(example.pose);
    far.add(example, *view, example.pose);
    const std::string name = "the root " + std::to_string(int(distance)) + " m away";
    rows.push_back({name, "largest error of a centre against float64 [m]", Bound::kAtMost, limit,
                    far.centre_m});
    rows.push_back({name, "values of Gaussians that are not finite", Bound::kAtMost, 0,
                    double(far.not_finite)});
  }
  return rows;
}

Rows extreme_heads() {
  Rows rows;
  // Outputs of 1e30: log-scales meet their bound, opacities are exactly 0 or 1, offsets throw the
  // Gaussian out of sight; nothing may be NaN on the way to the picture. Outputs that overflow make
  // NaN in the network; their Gaussians are left out.
  for (const auto& [name, magnitude] :
       {std::pair<const char*, float>{"head outputs of 1e30", 1e30f},
        {"head outputs that overflow", 3e38f}}) {
    FiveTexels example;
    for (size_t i = 0; i < example.network_bias.size(); ++i) {
      if (i >= 3) example.network_bias[i] = i % 2 == 0 ? magnitude : -magnitude;
    }
    if (magnitude > 1e38f) {
      for (float& weight : example.network_weights) weight *= magnitude;
    }
    Stage stage(example);
    std::vector<float> rgba;
    const Status status = stage.draw(example.pose, example.camera, rgba);
    rows.push_back({name, "frames that fail", Bound::kAtMost, 0, status.ok() ? 0.0 : 1.0});
    rows.push_back({name, "pixel values that are not finite", Bound::kAtMost, 0,
                    double(count_not_finite(rgba))});
    if (magnitude < 1e38f) {
      double largest = 0, beyond = 0;
      const Result<GaussianView> view = stage.pose(example.pose);
      for (float value : view->covariance_factor)
        largest = std::max(largest, double(std::abs(value)));
      for (float value : view->opacity) beyond += !(value >= 0 && value <= 1);
      rows.push_back({name, "largest entry of a factor [m]; spacing_scale x 0.06 m x e^4 = 1.97",
                      Bound::kAtMost, 1.97, largest});
      rows.push_back({name, "opacities outside 0 to 1", Bound::kAtMost, 0, beyond});
    }
  }
  // (1,0,0,0) + h = 0: no rotation is left, the identity stands in.
  FiveTexels example;
  std::fill(example.network_weights.begin(), example.network_weights.end(), 0.0f);
  std::fill(example.network_bias.begin(), example.network_bias.end(), 0.0f);
  const auto factors = [&] {
    Stage stage(example);
    const Result<GaussianView> view = stage.pose(example.pose);
    return std::vector<float>(view->covariance_factor.begin(), view->covariance_factor.end());
  };
  const std::vector<float> identity = factors();
  example.network_bias[6] = -1;
  rows.push_back({"a head whose quaternion is zero",
                  "values of factors that differ from no rotation's", Bound::kAtMost, 0,
                  double(count_different(identity, factors()))});
  return rows;
}

// Smallest extents from a nanometre to 25 m on Gaussians whose scales are at their bounds or apart
// by e^8: a root of a sum of squares and three ratios, nothing of which may vanish into NaN.
Rows smallest_extents() {
  const std::string name = "smallest extents of 1 nm to 25 m on scales at their bounds";
  double not_finite_values = 0, outside = 0, largest = 0, pixels_not_finite = 0;
  std::vector<float> rgba;
  for (const std::array<float, 4>& head : {std::array<float, 4>{-1e30f, -1e30f, -1e30f, 0},
                                           {1e30f, 1e30f, 1e30f, 1e30f},
                                           {1e30f, -1e30f, -1e30f, 0},
                                           {0, 0, -1e30f, -1e30f},
                                           {0, 0, 0, 3}}) {
    FiveTexels example;
    std::fill(example.network_weights.begin(), example.network_weights.end(), 0.0f);
    for (size_t k = 0; k < 3; ++k) example.network_bias[3 + k] = head[k];
    example.network_bias[10] = head[3];
    const FiveTexelsPackages packages(example);
    const std::unique_ptr<Renderer> renderer = std::move(Renderer::create({})).value();
    const auto pose = [&](const Avatar& avatar) {
      const AvatarId id = renderer->add_avatar(avatar, packages.body()).value();
      const FrameAvatar seen[] = {{.avatar = id, .pose = example.pose}};
      rgba.assign(size_t(example.camera.width_px) * example.camera.height_px * 4, kNan);
      const Status drawn = renderer->render(
          {.camera = example.camera, .avatars = seen, .splat = {.antialiased = true}},
          {.pixels = rgba.data(),
           .stride_bytes = 16 * size_t(example.camera.width_px),
           .format = PixelFormat::kRgbaF32});
      pixels_not_finite += drawn.ok() ? double(count_not_finite(rgba)) : double(rgba.size());
      const GaussianView view = renderer->pose_avatar(id, example.pose).value();
      not_finite_values += double(not_finite(view));
      GaussianSet set;
      set.covariance_factor.assign(view.covariance_factor.begin(), view.covariance_factor.end());
      set.opacity.assign(view.opacity.begin(), view.opacity.end());
      return set;
    };
    Avatar avatar = packages.avatar().avatar();
    const GaussianSet before = pose(avatar);
    const std::vector<uint8_t> codes{0, 1, 2, 254, 255};
    for (const float scale_m : {kLeastExtentScale_m, 1e-5f, kMostExtentScale_m}) {
      avatar.smallest_extents = {.scale_m = scale_m, .codes = codes};
      const GaussianSet after = pose(avatar);
      for (size_t i = 0; i < codes.size(); ++i) {
        outside += !(after.opacity[i] >= 0 && after.opacity[i] <= before.opacity[i]);
        // A column's length is a scale times what the pose makes of its axis.
        double expected = before.opacity[i];
        for (size_t j = 0; j < 3; ++j) {
          double own = 0, wide = 0;
          for (size_t r = 0; r < 3; ++r) {
            own += std::pow(double(before.covariance_factor[9 * i + 3 * r + j]), 2);
            wide += std::pow(double(after.covariance_factor[9 * i + 3 * r + j]), 2);
          }
          expected *= std::sqrt(own / wide);
        }
        if (expected > 1e-30)
          largest = std::max(largest, std::abs(after.opacity[i] - expected) / expected);
      }
    }
  }
  return {
      {name, "values of Gaussians that are not finite", Bound::kAtMost, 0, not_finite_values},
      {name, "pixel values that are not finite, antialiased", Bound::kAtMost, 0, pixels_not_finite},
      {name, "opacities outside 0 and what they were", Bound::kAtMost, 0, outside},
      {name, "largest relative error of opacity times volume", Bound::kAtMost, 2e-6, largest}};
}

// What is known about three joints, with variances of next to nothing, of one training pose, and of
// usual ones; asked about rotations that are none, and about anything else.
Rows known_poses() {
  std::vector<float> mean(9, 0.1f), covariance(81, 0);
  mean[1] = 0;  // of the root's tilt
  double not_finite_values = 0, beyond = 0, from_mean = 0;
  size_t pulled_poses = 0;
  const auto ask = [&](const KnownPoses& known, std::vector<float> rotations, double largest) {
    const PoseRarity rarity = known.rarity(rotations);
    not_finite_values += !std::isfinite(rarity.distance) + !std::isfinite(rarity.share_beyond);
    std::vector<float> pulled = rotations;
    if (!known.pull(rotations, pulled)) return;
    ++pulled_poses;
    not_finite_values += double(count_not_finite(pulled));
    if (largest > 0) beyond = std::max(beyond, known.distance(pulled) / largest);
    if (largest > 0) return;
    std::vector<double> x(9);
    const uint8_t joints[] = {0, 1, 2};
    pose_features(joints, pulled, x);
    for (size_t i = 0; i < 9; ++i) from_mean = std::max(from_mean, std::abs(x[i] - mean[i]));
  };
  for (const float variance : {1e-37f, 9e-4f, 1.0f}) {
    for (size_t i = 0; i < 9; ++i) covariance[10 * i] = variance;
    for (const std::vector<float>& distances : {std::vector<float>{0, 0}, {1, 2, 2, 3}}) {
      const KnownPoses known =
          std::move(KnownPoses::create({{0, 1, 2}, mean, covariance, distances})).value();
      // A distance of the pulled pose's can be told where floats can tell the deviations apart.
      const double largest = variance > 1e-30f ? double{distances.back()} : 1e30;
      for (const float bad : {0.0f, kNan, kInfinity, -kInfinity, 1e-20f, 1e25f}) {
        for (size_t at = 0; at < 12; ++at) {
          std::vector<float> rotations{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
          rotations[4 * (at / 4)] = 0;
          rotations[at] = bad;
          ask(known, rotations, largest);
        }
      }
      uint64_t state = 1;
      for (int pose = 0; pose < 2000; ++pose) {
        std::vector<float> rotations(12);
        for (float& value : rotations) {
          state = state * 6364136223846793005u + 1442695040888963407u;
          value = static_cast<float>(static_cast<double>(state >> 11) * 0x1p-53 - 0.5);
        }
        ask(known, rotations, largest);
      }
    }
  }
  const std::string name = "known poses, asked about 12,000 random ones and 432 that are none";
  return {{name, "distances, shares and rotations that are not finite", Bound::kAtMost, 0,
           not_finite_values},
          {name, "poses that were not pulled", Bound::kAtMost, 432, 12432.0 - double(pulled_poses)},
          {name, "largest distance of a pulled pose, of the farthest training pose's",
           Bound::kAtMost, 1.0001, beyond},
          {"known poses, of one training pose", "largest distance of a pulled pose from it [rad]",
           Bound::kAtMost, 1e-6, from_mean}};
}

constexpr Case kCases[] = {{"Twists180", twists},
                           {"RotationsThatAreNone", rotations_that_are_none},
                           {"PosesFarOutside", far_poses},
                           {"ExtremeHeads", extreme_heads},
                           {"SmallestExtents", smallest_extents},
                           {"KnownPoses", known_poses}};

}  // namespace
}  // namespace pose

std::span<const Case> pose_cases() { return pose::kCases; }

}  // namespace figurine::stability
