// figurine selftest: draws the package's golden frame on this device and compares it: in float with
// the picture that the trainer's renderer made of it, in fixed point with the hash that it has on
// every device. Of a sampler: samples its golden seeds and compares the weights' hashes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <format>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "ports/media/png.h"
#include "samples/common/device_options.h"
#include "samples/common/image_error.h"
#include "samples/common/loading.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/figurine/commands.h"

namespace figurine::samples {

namespace {

// Float pictures of trainer and device agree to 60 dB or better, an rms difference of 0.255 levels
// of 255. Both pictures are then rounded to whole levels, which adds at most two independent errors
// of variance 1/12: sqrt(0.255^2 + 2/12) = 0.48 levels, 54.5 dB.
constexpr double kLeastPsnr_db = 54;
// The golden picture's own foreground, where the device drew nothing: a difference from the
// background that no rounding makes.
constexpr int kForegroundLevels = 25;

struct SelftestOptions {
  SceneOptions scene;
  DeviceOptions device;
};

struct Comparison {
  ErrorSum error;           // over the foreground, in units of the full scale
  uint64_t foreground = 0;  // pixels
};

// alpha is the device's; background is what both pictures were drawn over.
Comparison compare(const ports::ImageU8& golden, const ports::ImageU8& device,
                   const ports::ImageF32& alpha, const std::array<float, 3>& background) {
  Comparison result;
  for (size_t pixel = 0; pixel < size_t(golden.width_px) * golden.height_px; ++pixel) {
    const uint8_t* g = &golden.pixels[pixel * golden.channels];
    const uint8_t* d = &device.pixels[4 * pixel];
    bool foreground = alpha.pixels[4 * pixel + 3] > 0.5f;
    for (int c = 0; c < 3; ++c)
      foreground =
          foreground || std::abs(g[c] - std::lround(background[c] * 255)) > kForegroundLevels;
    if (!foreground) continue;
    ++result.foreground;
    for (int c = 0; c < 3; ++c) result.error.add((int(d[c]) - int(g[c])) / 255.0);
  }
  return result;
}

// The golden frame as this device draws it.
struct Golden {
  RenderedFrame picture;                     // over the golden background
  std::optional<RenderedFrame> transparent;  // for its alpha, which only pictures are compared by
};

Result<Golden> draw_golden(const SelftestOptions& options, const RendererOptions& renderer_options,
                           Precision precision) {
  Result<Scene> scene = Scene::load(options.scene);
  if (!scene.ok()) return scene.status();
  const GoldenFrame& golden = scene->avatar(0).avatar.golden;
  Result<std::unique_ptr<Renderer>> renderer = make_renderer(renderer_options);
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene->add_to(**renderer, precision));
  const ImageSize size{golden.camera.width_px, golden.camera.height_px};
  Golden drawn{RenderedFrame(size, PixelFormat::kRgba8), {}};
  const std::span<const FrameAvatar> posed = scene->pose(0);
  FIG_RETURN_IF_ERROR((*renderer)->render(
      {.camera = golden.camera, .avatars = posed, .background = golden.background},
      drawn.picture.target()));
  if (precision == Precision::kFloat32) {
    drawn.transparent.emplace(size, PixelFormat::kRgbaF32);
    FIG_RETURN_IF_ERROR((*renderer)->render({.camera = golden.camera, .avatars = posed},
                                            drawn.transparent->target()));
  }
  return drawn;
}

// What one precision says of itself: in JSON, to people, and in one line if it failed.
struct Verdict {
  bool passed = false;
  nlohmann::ordered_json json;
  std::string text, reason;
};

Result<Verdict> compare_floats(const SelftestOptions& options,
                               const RendererOptions& renderer_options, const GoldenFrame& golden) {
  const std::string& path = options.scene.avatars[0];
  const Result<ports::ImageU8> expected =
      ports::decode_png(std::as_bytes(golden.png), path + ": golden frame");
  if (!expected.ok()) return expected.status();
  if (expected->width_px != golden.camera.width_px ||
      expected->height_px != golden.camera.height_px || expected->channels < 3) {
    return Status(StatusCode::kCorrupt,
                  path + ": golden frame: the picture's size or channels are not the camera's");
  }
  const Result<Golden> drawn = draw_golden(options, renderer_options, Precision::kFloat32);
  if (!drawn.ok()) return drawn.status();
  const Comparison result =
      compare(*expected, drawn->picture.u8, drawn->transparent->f32, golden.background);
  const double psnr_db = result.error.psnr_db();
  const long largest = std::lround(result.error.largest * 255);
  Verdict verdict{.passed = result.foreground > 0 && psnr_db >= kLeastPsnr_db,
                  .json = {},
                  .text = {},
                  .reason = {}};
  verdict.json["psnr_db"] = std::isinf(psnr_db)
                                ? nlohmann::ordered_json()
                                : nlohmann::ordered_json(psnr_db);  // null: equal to the bit
  verdict.json["least_psnr_db"] = kLeastPsnr_db;
  verdict.json["largest_difference_levels"] = largest;
  verdict.json["foreground_pixels"] = result.foreground;
  verdict.text = std::format(
      "f32: golden frame {}: {:.2f} dB over {} foreground pixels (at least {:.0f}), largest "
      "difference {} of 255",
      verdict.passed ? "agrees" : "DIFFERS", psnr_db, result.foreground, kLeastPsnr_db, largest);
  verdict.reason = "this device's picture differs from the trainer's";
  return verdict;
}

Result<Verdict> compare_hashes(const SelftestOptions& options,
                               const RendererOptions& renderer_options, const GoldenFrame& golden) {
  const Result<Golden> drawn = draw_golden(options, renderer_options, Precision::kFixedPoint);
  if (!drawn.ok()) return drawn.status();
  const std::array<uint64_t, 2> hash = hash_picture(drawn->picture.u8.pixels);
  const std::string here = format_hash(hash), there = format_hash(golden.fixed_point_hash);
  Verdict verdict{.passed = hash == golden.fixed_point_hash, .json = {}, .text = {}, .reason = {}};
  verdict.json["fixed_point"] = {{"passed", verdict.passed},
                                 {"hash", here},
                                 {"golden_hash", there},
                                 {"library", network_library()},
                                 {"golden_library", golden.fixed_point_library}};
  verdict.text = verdict.passed ? "q8: golden frame agrees to the bit: " + here
                                : "q8: golden frame DIFFERS: " + here + ", not " + there;
  verdict.reason = std::format(
      "in fixed point this device's picture is {} by {}, the package's {} by {}", here,
      network_library(), there,
      golden.fixed_point_library.empty() ? "an unknown library" : golden.fixed_point_library);
  return verdict;
}

// In every precision asked for that the package has a golden picture of.
Result<std::vector<Verdict>> judge(const SelftestOptions& options,
                                   const RendererOptions& renderer_options) {
  const std::string& path = options.scene.avatars[0];
  const Result<std::unique_ptr<LoadedAvatar>> loaded = load_avatar(path);
  if (!loaded.ok()) return loaded.status();
  const Avatar& avatar = (*loaded)->avatar;
  const std::optional<Precision> asked = options.device.network_precision();
  const auto wanted = [&](Precision precision) {
    return asked ? *asked == precision : avatar.holds(precision);
  };
  std::vector<Verdict> verdicts;
  if (wanted(Precision::kFixedPoint) &&
      avatar.golden.fixed_point_hash != std::array<uint64_t, 2>{0, 0}) {
    Result<Verdict> verdict = compare_hashes(options, renderer_options, avatar.golden);
    if (!verdict.ok()) return verdict.status();
    verdicts.push_back(std::move(*verdict));
  }
  if (wanted(Precision::kFloat32) && !avatar.golden.png.empty()) {
    Result<Verdict> verdict = compare_floats(options, renderer_options, avatar.golden);
    if (!verdict.ok()) return verdict.status();
    verdicts.push_back(std::move(*verdict));
  }
  if (verdicts.empty())
    return Status(StatusCode::kNotFound,
                  path + ": golden frame: the package has nothing to compare with");
  return verdicts;
}

Status run_sampler_selftest(const Package& package, const std::string& path,
                            const DeviceOptions& options) {
  const Sampler& sampler = package.sampler();
  if (sampler.golden_seeds.empty())
    return Status(StatusCode::kNotFound,
                  path + ": golden seeds: the package has none to compare with");
  const Result<Isa> isa = options.instruction_set();
  if (!isa.ok()) return isa.status();
  const Result<std::unique_ptr<AvatarSampler>> device = AvatarSampler::create(sampler, *isa);
  if (!device.ok()) return device.status().within(path);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::string reason;
  SampledAvatar person;
  Progress progress("selftest", sampler.golden_seeds.size());
  for (const GoldenSeed& golden : sampler.golden_seeds) {
    FIG_RETURN_IF_ERROR(check_interrupt());
    FIG_RETURN_IF_ERROR(
        (*device)
            ->sample({.seed = golden.seed, .steps = golden.steps, .method = golden.method}, person)
            .within(path));
    const Avatar& avatar = person.avatar();
    const std::string here = format_hash(
                          hash_weights(avatar.fixed_point, avatar.shape, avatar.static_part)),
                      there = format_hash(golden.hash);
    const std::string seed = std::format("seed {} in {} steps of {}", golden.seed, golden.steps,
                                         to_string(golden.method));
    if (here != there && reason.empty())
      reason = std::format("{}: this device's weights are {}, the package's {}", seed, here, there);
    rows.push_back({{"seed", golden.seed},
                    {"steps", golden.steps},
                    {"solver", to_string(golden.method)},
                    {"passed", here == there},
                    {"hash", here},
                    {"golden_hash", there}});
    if (options.json != "-") {
      std::printf("%s: %s %s: %s\n", path.c_str(), seed.c_str(),
                  here == there ? "agrees to the bit" : "DIFFERS", here.c_str());
    }
    progress.update(rows.size());
  }
  if (!options.json.empty()) {
    nlohmann::ordered_json json = json_header("selftest");
    json["sampler"] = path;
    json["passed"] = reason.empty();
    json["golden_seeds"] = rows;
    json["machine"] = json_sampling_machine((*device)->isa());
    FIG_RETURN_IF_ERROR(write_json(options.json, json));
  }
  return reason.empty() ? Status()
                        : Status(StatusCode::kMismatch, path + ": golden seeds: " + reason);
}

Status run_selftest(const SelftestOptions& options) {
  // Whatever else it is, or is not, is said by what loads an avatar.
  if (const auto loaded = load_package(options.scene.avatars[0]);
      loaded.ok() && (*loaded)->package.kind() == PackageKind::kSampler) {
    return run_sampler_selftest((*loaded)->package, options.scene.avatars[0], options.device);
  }
  const Result<RendererOptions> renderer_options = options.device.renderer_options();
  if (!renderer_options.ok()) return renderer_options.status();
  const std::string& path = options.scene.avatars[0];
  const Result<std::vector<Verdict>> verdicts = judge(options, *renderer_options);
  if (!verdicts.ok()) return verdicts.status();
  const auto failed = std::find_if(verdicts->begin(), verdicts->end(),
                                   [](const Verdict& verdict) { return !verdict.passed; });
  const bool passed = failed == verdicts->end();
  if (!options.device.json.empty()) {
    nlohmann::ordered_json json = json_header("selftest");
    json["avatar"] = path;
    json["passed"] = passed;
    for (const Verdict& verdict : *verdicts) json.update(verdict.json);
    const std::string precision = verdicts->size() > 1                             ? "mixed"
                                  : verdicts->front().json.contains("fixed_point") ? "q8"
                                                                                   : "f32";
    json["machine"] = json_machine(options.device, renderer_options->threads, precision);
    FIG_RETURN_IF_ERROR(write_json(options.device.json, json));
  }
  if (options.device.json != "-") {
    for (const Verdict& verdict : *verdicts)
      std::printf("%s: %s\n", path.c_str(), verdict.text.c_str());
  }
  return passed ? Status()
                : Status(StatusCode::kMismatch, path + ": golden frame: " + failed->reason);
}

}  // namespace

Command add_selftest_command(CLI::App& app) {
  auto options = std::make_shared<SelftestOptions>();
  CLI::App* command = app.add_subcommand("selftest",
                                         "Compares what this device makes of the golden frame, or "
                                         "of a sampler's golden seeds, with the package's");
  options->scene.avatars.resize(1);
  command
      ->add_option("avatar", options->scene.avatars[0],
                   "avatar or sampler package (.fgn), or a member of a population "
                   "(people.fgn#NAME, people.fgn#17)")
      ->required();
  add_body_option(*command, options->scene.body);
  options->device.add_to(*command);
  return {command, [options] { return run_selftest(*options); }};
}

}  // namespace figurine::samples
