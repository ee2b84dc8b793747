// figurine selftest: draws the package's golden frame on this device and compares it with the picture that the trainer's renderer made of
// it.
#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/linux/png.h"
#include "samples/figurine/cast.h"
#include "samples/figurine/commands.h"
#include "samples/figurine/device_options.h"
#include "samples/figurine/frame_sink.h"
#include "samples/figurine/image_error.h"

namespace figurine::samples {

namespace {

// Float pictures of trainer and device agree to 60 dB or better, an rms difference of 0.255 levels of 255. Both pictures are then rounded
// to whole levels, which adds at most two independent errors of variance 1/12: sqrt(0.255^2 + 2/12) = 0.48 levels, 54.5 dB.
constexpr double kLeastPsnr_db = 54;
// The golden picture's own foreground, where the device drew nothing: a difference from the background that no rounding makes.
constexpr int kForegroundLevels = 25;

struct SelftestOptions {
  CastOptions cast;
  DeviceOptions device;
};

struct Comparison {
  ErrorSum error;           // over the foreground, in units of the full scale
  uint64_t foreground = 0;  // pixels
};

// alpha is the device's; background is what both pictures were drawn over.
Comparison compare(const ports::ImageU8& golden, const ports::ImageU8& device, const ports::ImageF32& alpha,
                   const std::array<float, 3>& background) {
  Comparison result;
  for (size_t pixel = 0; pixel < size_t(golden.width_px) * golden.height_px; ++pixel) {
    const uint8_t* g = &golden.pixels[pixel * golden.channels];
    const uint8_t* d = &device.pixels[4 * pixel];
    bool foreground = alpha.pixels[4 * pixel + 3] > 0.5f;
    for (int c = 0; c < 3; ++c) foreground = foreground || std::abs(g[c] - std::lround(background[c] * 255)) > kForegroundLevels;
    if (!foreground) continue;
    ++result.foreground;
    for (int c = 0; c < 3; ++c) result.error.add((int(d[c]) - int(g[c])) / 255.0);
  }
  return result;
}

Status run_selftest(const SelftestOptions& options) {
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  const std::string& path = options.cast.avatars[0];
  Result<Cast> cast = Cast::load(options.cast);
  if (!cast.ok()) return cast.status();
  const GoldenFrame& golden = cast->avatar(0).package.avatar().golden;
  if (golden.png.empty()) return Status(StatusCode::kNotFound, path + ": golden frame: the package has no picture to compare with");
  const Result<ports::ImageU8> expected = ports::decode_png(std::as_bytes(golden.png), path + ": golden frame");
  if (!expected.ok()) return expected.status();
  if (expected->width_px != golden.camera.width_px || expected->height_px != golden.camera.height_px || expected->channels < 3) {
    return Status(StatusCode::kCorrupt, path + ": golden frame: the picture's size or channels are not the camera's");
  }

  Result<std::unique_ptr<Renderer>> renderer = Renderer::create(*renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(cast->add_to(**renderer));
  const ImageSize size{golden.camera.width_px, golden.camera.height_px};
  RenderedFrame picture(size, PixelFormat::kRgba8), transparent(size, PixelFormat::kRgbaF32);
  const std::span<const FrameAvatar> posed = cast->pose(0);
  FIG_RETURN_IF_ERROR((*renderer)->render({.camera = golden.camera, .avatars = posed, .background = golden.background}, picture.target()));
  FIG_RETURN_IF_ERROR((*renderer)->render({.camera = golden.camera, .avatars = posed}, transparent.target()));

  const Comparison result = compare(*expected, picture.u8, transparent.f32, golden.background);
  const double psnr_db = result.error.psnr_db();
  const bool passed = result.foreground > 0 && psnr_db >= kLeastPsnr_db;
  if (options.device.json) {
    nlohmann::ordered_json json = json_header("selftest");
    json["avatar"] = path;
    json["passed"] = passed;
    json["psnr_db"] = std::isinf(psnr_db) ? nlohmann::ordered_json() : nlohmann::ordered_json(psnr_db);  // null: equal to the bit
    json["least_psnr_db"] = kLeastPsnr_db;
    json["largest_difference_levels"] = std::lround(result.error.largest * 255);
    json["foreground_pixels"] = result.foreground;
    json["machine"] = json_machine(options.device, renderer_options->threads);
    print_json(json);
  } else {
    std::printf("%s: golden frame %s: %.2f dB over %llu foreground pixels (at least %.0f), largest difference %ld of 255\n", path.c_str(),
                passed ? "agrees" : "DIFFERS", psnr_db, static_cast<unsigned long long>(result.foreground), kLeastPsnr_db,
                std::lround(result.error.largest * 255));
  }
  if (passed) return {};
  return Status(StatusCode::kMismatch, path + ": golden frame: this device's picture differs from the trainer's");
}

}  // namespace

Command add_selftest_command(CLI::App& app) {
  auto options = std::make_shared<SelftestOptions>();
  CLI::App* command = app.add_subcommand("selftest", "Compares this device's picture of the golden frame with the package's");
  options->cast.avatars.resize(1);
  command->add_option("avatar", options->cast.avatars[0], "avatar package (.fgn)")->required();
  command->add_option("--body", options->cast.body,
                      "body package; default: found by content hash beside the avatar, then in FIGURINE_PATH");
  options->device.add_to(*command);
  return {command, [options] { return run_selftest(*options); }};
}

}  // namespace figurine::samples
