#include "toolchain/train/smallest_extent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "toolchain/error.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::train {

namespace {

// Mip-Splatting's low-pass filter at a sampling interval of 1 has the variance 0.2.
const float kDeviationPerSample = std::sqrt(0.2f);
constexpr float kUnseen = std::numeric_limits<float>::infinity();
constexpr uint8_t kInside = 128;  // of a mask: at least half covered

struct PosedTexel {
  std::array<float, 3> position_m, normal;  // in the world
};

std::vector<PosedTexel> pose_texels(const AvatarModel& model, const dataset::CaptureFrame& frame) {
  const Body& body = model.body();
  const OwnedPose pose = model.from_capture(frame);
  const PosedBody posed = model.pose(pose.view());
  const std::span<const float> canonical = model.head_frame(posed).texel_position_m;
  std::vector<PosedTexel> texels(body.texel_count());
  for (size_t i = 0; i < texels.size(); ++i) {
    const Affine transform = blend(posed.world_from_rest, &body.texel_joints[i * kSkinInfluences],
                                   &body.texel_weights[i * kSkinInfluences]);
    texels[i] = {transform_point(transform, &canonical[3 * i]),
                 transform_normal(transform, &body.texel_normal[3 * i])};
  }
  return texels;
}

// Where a camera has a texel, if it is in front of it, inside the picture and faces it.
struct Seen {
  uint32_t x, y;
  float extent_m;
};
std::optional<Seen> see(const PosedTexel& texel, const Camera& camera) {
  const std::array<float, 12>& m = camera.view_from_world;
  const std::array<float, 3> at = transform_point({m}, texel.position_m.data());
  if (!(at[2] > camera.near_m)) return std::nullopt;
  float along = 0;  // the normal against the ray, both in the camera's frame
  for (size_t r = 0; r < 3; ++r) {
    float component = 0;
    for (size_t k = 0; k < 3; ++k) component += m[4 * r + k] * texel.normal[k];
    along += component * at[r];
  }
  if (!(along < 0)) return std::nullopt;
  const float x = camera.fx_px * at[0] / at[2] + camera.cx_px,
              y = camera.fy_px * at[1] / at[2] + camera.cy_px;
  const auto inside = [](float value, uint32_t size) {
    return value >= 0 && value < static_cast<float>(size);
  };
  if (!inside(x, camera.width_px) || !inside(y, camera.height_px)) return std::nullopt;
  return Seen{static_cast<uint32_t>(x), static_cast<uint32_t>(y),
              kDeviationPerSample * at[2] / std::max(camera.fx_px, camera.fy_px)};
}

// Training poses, evenly spread.
std::vector<size_t> chosen_frames(const dataset::Dataset& data) {
  std::vector<size_t> frames, chosen;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    if (data.frames()[frame].split == dataset::FrameSplit::kTrain) frames.push_back(frame);
  }
  const size_t count = std::min(kExtentPoses, frames.size());
  for (size_t i = 0; i < count; ++i) chosen.push_back(frames[i * frames.size() / count]);
  return chosen;
}

}  // namespace

void SmallestExtentMap::set(float scale_m, std::vector<uint8_t> codes, const std::string& where) {
  if (codes.size() != texels_) {
    throw InputError(where + ": smallest extents: " + std::to_string(codes.size()) +
                     " codes, the body has " + std::to_string(texels_) + " texels");
  }
  const SmallestExtents extents{.scale_m = scale_m, .codes = codes};
  throw_if_error(validate_smallest_extents(extents, kMaxUvSize), where);
  scale_m_ = scale_m;
  codes_ = std::move(codes);
  extent_m_.resize(texels_);
  for (size_t i = 0; i < texels_; ++i) extent_m_[i] = view().extent_m(i);
}

SmallestExtents SmallestExtentMap::view() const { return {.scale_m = scale_m_, .codes = codes_}; }

void round_extents(const std::vector<float>& extent_m, const std::string& where,
                   SmallestExtentMap& map) {
  const float largest = *std::max_element(extent_m.begin(), extent_m.end());
  const float scale_m = largest / static_cast<float>(kLargestExtentCode);
  std::vector<uint8_t> codes;
  for (const float extent : extent_m)
    codes.push_back(static_cast<uint8_t>(std::clamp(std::round(extent / scale_m), 1.0f, 255.0f)));
  map.set(scale_m, std::move(codes), where);
}

std::vector<float> measure_extents(const dataset::Dataset& data, const AvatarModel& model) {
  std::vector<float> extent_m(model.body().texel_count(), kUnseen);
  std::vector<std::pair<size_t, Seen>> sharper;  // texels that a view may have seen best
  for (const size_t frame : chosen_frames(data)) {
    const std::vector<PosedTexel> texels = pose_texels(model, data.frames()[frame]);
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      if (data.role(frame, camera) != dataset::Role::kTrain) continue;
      const Camera& view = data.cameras()[camera].camera;
      sharper.clear();
      for (size_t i = 0; i < texels.size(); ++i) {
        const std::optional<Seen> seen = see(texels[i], view);
        if (seen && seen->extent_m < extent_m[i]) sharper.emplace_back(i, *seen);
      }
      if (sharper.empty()) continue;  // and its mask need not be read
      const dataset::CaptureImage image = data.load_image(frame, camera);
      for (const auto& [texel, seen] : sharper) {
        if (image.alpha[size_t{seen.y} * image.width_px + seen.x] >= kInside)
          extent_m[texel] = seen.extent_m;
      }
    }
  }
  float largest = 0;
  for (const float extent : extent_m)
    largest = extent < kUnseen ? std::max(largest, extent) : largest;
  if (largest == 0) throw InputError(data.directory() + ": no training view shows any texel");
  for (float& extent : extent_m) extent = extent < kUnseen ? extent : largest;
  return extent_m;
}

}  // namespace figurine::train
