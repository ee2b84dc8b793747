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
#include "figurine/ycbcr.h"

namespace figurine {

enum class AvatarId : uint32_t {};

enum class PixelFormat : uint8_t {
  kRgba8,    // sRGB-encoded as stored in the Gaussians, straight alpha, rounded to nearest
  kRgbaF32,  // the same without rounding or clamping
  // What screens and cameras take: kRgba8's codes in another order or, by figurine/ycbcr.h, in
  // limited-range YCbCr. All but kBgra8 have no alpha and need a Frame::background.
  kBgra8,
  kRgb24,  // 3 bytes a pixel
  kBgr24,
  kYuyv,  // 4:2:2, Y Cb Y Cr (YUY2): chroma of the mean of two neighbours; even width
  kNv12,  // 4:2:0, a plane of Y and one of Cb Cr: chroma of the mean of 2x2; even width and height
};
const char* to_string(PixelFormat format);  // "rgba8", "nv12", ...: for messages

// Where a frame goes: height rows of stride_bytes, top row first. The caller owns the pixels.
struct ImageTarget {
  void* pixels = nullptr;
  size_t stride_bytes = 0;
  PixelFormat format = PixelFormat::kRgba8;
  // kNv12 alone: its plane of Cb and Cr, height / 2 rows of chroma_stride_bytes, width bytes of
  // each in use. Anywhere outside the plane of Y; drivers want it right behind that.
  void* chroma = nullptr;
  size_t chroma_stride_bytes = 0;
  YcbcrMatrix matrix = YcbcrMatrix::kBt709;  // of kYuyv and kNv12
};

struct SplatOptions {
  float alpha_cut = kAlphaCut;  // contributions below it are skipped; in (0, 0.5]
  // What widens a Gaussian to the pixel grid takes from its opacity what it adds to its area
  // (docs/numerics.md, "Splatting", 5): for Gaussians that were trained so, which look thin without
  // it and others with it. None: every avatar as its package says, other Gaussians without.
  std::optional<bool> antialiased = std::nullopt;
};

// What a frame need not compute because nobody would see it. Every omission here is exact: the
// picture is the same to the bit with and without it, so a switch is for measuring what it is
// worth. FrameStatistics::left_out counts.
struct LeaveOut {
  bool hidden_texels = true;  // texels that the camera cannot see, before the head is decoded; only
                              // of avatars whose offsets have a bound (HeadDecoding::max_offset)
  bool transparent = true;    // Gaussians whose opacity is below the alpha cut
  bool outside = true;        // Gaussians that touch no pixel of the image
  bool missed_tiles = true;   // tiles of a Gaussian's box that its ellipse does not reach
  bool stopped = true;        // the rest of a tile's Gaussians once all of its pixels have stopped
  bool unchanged_networks = true;  // runs of networks whose last run was for the same pose, to the
                                   // bit: their outputs are still there
};

// What a frame may leave out although it shows: off unless asked for. FrameStatistics counts.
struct Approximation {
  // Avatars whose box in the image has both sides below this many pixels keep what their network
  // said of the pose that it ran for last, however long ago; skeleton, skinning and everything
  // behind follow the pose as always. The picture then depends on the frames before it. Each avatar
  // is for itself, but of several that are held once (Renderer::add_avatar) only that one profits
  // for which the network ran last. 0: every pose has its run.
  float network_below_px = 0;
  // An avatar's network runs for one of this many poses. At those in between its outputs go on in
  // the straight line of its last two runs, while skeleton, skinning and everything behind follow
  // the pose as always. Avatars take turns. The picture then depends on the frames before it, and
  // of several avatars that are held once nobody profits. At least 1: every pose has its run.
  uint32_t network_interval = 1;
  // Figures that are smaller than this in the image, by the box of their joints' positions, are
  // drawn by their FrameAvatar::coarse where they have one. 0: never.
  float coarse_below_px = 0;
  // Texels are left out whose surface faces away from the camera: where the cosine of the angle
  // between the line of sight and the posed normal is above this. A closed body hides them; what is
  // thin, or not quite opaque, shows it. In [0, 1]; 1: none.
  float averted_above = 1;
  // Bands of spherical harmonics above this degree are left out.
  uint32_t sh_degree = kMaxShDegree;
  // The fast tier of the blend: products added without rounding them first, 2^x by a cubic, and a
  // pixel stops at 1/255 of its light, after the contribution that took it there, in place of
  // 1/10,000 before it. Over 50 dB from the exact picture (docs/numerics.md, "Splatting"), and
  // other last bits on other instruction sets.
  bool fast_blend = false;
};

struct FrameAvatar {
  AvatarId avatar{};
  PoseView pose;
  // The same person in fewer texels and a smaller network, or none, for when the figure is small
  // (Approximation::coarse_below_px): of another body with the same joints.
  std::optional<AvatarId> coarse = std::nullopt;
  // Where the pose is farther out than 95 % of those that the avatar was trained on, its network is
  // shown one that is nearer (figurine/known_poses.h), while skeleton, skinning and everything
  // behind follow the true pose. Without a table of distances in the package (PoseStatistics),
  // nothing changes. The same pixels on every CPU and for any number of threads, as without.
  bool keep_to_known = false;
};

struct Frame {
  Camera camera;
  std::span<const FrameAvatar> avatars;
  std::span<const GaussianView> gaussians;  // static, world space
  std::optional<std::array<float, 3>>
      background;  // opaque colour behind; without it the image keeps its alpha
  SplatOptions splat;
  LeaveOut leave_out;
  Approximation approximation;
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
  uint64_t networks = 0;        // runs
  uint64_t stale_networks = 0;  // runs that Approximation's network_below_px or _interval saved
  uint64_t coarse_avatars = 0;  // drawn by their FrameAvatar::coarse
  uint64_t averted_texels = 0;  // left out by Approximation::averted_above
  uint64_t pulled_poses = 0;    // of avatars whose network was shown another (keep_to_known)
  struct LeftOut {
    uint64_t hidden_texels = 0;
    uint64_t transparent = 0, outside = 0;  // Gaussians
    uint64_t missed_tiles = 0;              // (Gaussian, tile) pairs of boxes
    uint64_t stopped = 0;                   // (Gaussian, tile) pairs behind stopped tiles
    uint64_t unchanged_networks = 0;        // runs
  } left_out;
};

}  // namespace figurine
