// One frame: what is seen, from where, into which pixels, and what drawing it took. The words that
// the renderer, its stages and its callers share; nothing here draws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "figurine/camera.h"
#include "figurine/gaussian.h"
#include "figurine/pose.h"

namespace figurine {

enum class AvatarId : uint32_t {};

enum class PixelFormat : uint8_t {
  kRgba8,    // sRGB-encoded as stored in the Gaussians, straight alpha, rounded to nearest
  kRgbaF32,  // the same without rounding or clamping
};

// Where a frame goes: height rows of stride_bytes, top row first. The caller owns the pixels.
struct ImageTarget {
  void* pixels = nullptr;
  size_t stride_bytes = 0;
  PixelFormat format = PixelFormat::kRgba8;
};

struct SplatOptions {
  float alpha_cut = kAlphaCut;  // contributions below it are skipped; in (0, 0.5]
};

struct FrameAvatar {
  AvatarId avatar{};
  PoseView pose;
};

struct Frame {
  Camera camera;
  std::span<const FrameAvatar> avatars;
  std::span<const GaussianView> gaussians;  // static, world space
  std::optional<std::array<float, 3>>
      background;  // opaque colour behind; without it the image keeps its alpha
  SplatOptions splat;
};

enum class Stage : uint8_t {
  kMaps,
  kNetwork,
  kDecode,
  kSkin,
  kProject,
  kBin,
  kSort,
  kBlend,
  kResolve
};
inline constexpr size_t kStageCount = 9;
const char* to_string(Stage stage);

struct FrameStatistics {
  std::array<uint64_t, kStageCount> stage_ns{};  // zero without a clock
  uint64_t gaussians = 0;                        // given to projection
  uint64_t visible = 0;                          // left after culling
  uint64_t pairs = 0;                            // (Gaussian, tile)
  uint64_t blends = 0;                           // contributions blended into pixels
  uint64_t macs = 0;
};

}  // namespace figurine
