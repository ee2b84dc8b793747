// figurine sample: the weights of an avatar that nobody has seen, from a sampler and a seed.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <format>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "figurine/renderer.h"
#include "formats/writer/package_writer.h"
#include "ports/command_line/values.h"
#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/device_options.h"
#include "samples/common/file_sink.h"
#include "samples/common/golden_picture.h"
#include "samples/common/loading.h"
#include "samples/common/machine.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/figurine/commands.h"
#include "samples/figurine/contact_sheet.h"

namespace figurine::samples {

namespace {

struct SampleOptions {
  std::string sampler, body, precision = "q8", solver, name, output, trace;
  SampleRequest request;
  std::optional<uint64_t> to;
  std::optional<double> mix;
  DeviceOptions device;
  RendererOptions renderer;  // that they ask for
};

// Draws what the denoiser believes in after every step: one picture each, and all of them in a
// strip. Nothing is there before all is.
class Strip final : public AvatarSampler::Trace {
 public:
  static Result<std::unique_ptr<Strip>> create(const std::string& folder, const Sampler& sampler,
                                               const Package& body, uint32_t steps,
                                               const RendererOptions& renderer) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) return Status(StatusCode::kIo, folder + ": cannot be created: " + error.message());
    const ImageSize size{sampler.golden.camera.width_px, sampler.golden.camera.height_px};
    Result<std::unique_ptr<FileSink>> sink = FileSink::create(
        folder + "/step_%04d.png", {.size = size, .frame_count = steps, .opaque = true});
    if (!sink.ok()) return sink.status();
    Result<ContactSheet> sheet = ContactSheet::create(
        {.frame_size = size, .frame_count = steps, .columns = 10, .tiles = 10});
    if (!sheet.ok()) return sheet.status();
    return std::unique_ptr<Strip>(
        new Strip(folder, body, renderer, std::move(*sink), std::move(*sheet)));
  }

  Status after_step(uint32_t step, double, const SampledAvatar& avatar) override {
    FIG_RETURN_IF_ERROR(check_interrupt());
    const Result<GoldenPicture> picture =
        draw_golden_picture(avatar.avatar(), *body_, Precision::kFixedPoint, renderer_);
    if (!picture.ok()) return picture.status();
    sheet_.offer(step - 1, picture->frame.u8);
    return sink_->add(picture->frame, step - 1);
  }

  Status finish() {
    FIG_RETURN_IF_ERROR(sink_->finish());
    return sheet_.write(folder_ + "/strip.png", true);
  }

 private:
  Strip(std::string folder, const Package& body, const RendererOptions& renderer,
        std::unique_ptr<FileSink> sink, ContactSheet sheet)
      : folder_(std::move(folder)),
        body_(&body),
        renderer_(renderer),
        sink_(std::move(sink)),
        sheet_(std::move(sheet)) {}

  std::string folder_;
  const Package* body_;
  RendererOptions renderer_;
  std::unique_ptr<FileSink> sink_;
  ContactSheet sheet_;
};

uint32_t steps_of(const SampleRequest& request, const Sampler& sampler) {
  return request.steps == 0 ? sampler.steps : request.steps;
}
SolverMethod method_of(const SampleRequest& request, const Sampler& sampler) {
  return request.method.value_or(sampler.method);
}

// The sampler's, with what makes this avatar this avatar.
Provenance provenance_of(const LoadedPackage& sampler, const SampleRequest& request) {
  const Sampler& from = sampler.package.sampler();
  Provenance provenance = sampler.package.provenance();
  provenance.tool = "figurine " FIGURINE_VERSION;
  provenance.quality.clear();  // the sampler's is of many avatars, not of this one
  provenance.settings = {{"sampled_by", from.name},
                         {"sampler_hash", format_hash(sampler.package.content_hash())},
                         {"seed", std::to_string(request.seed)},
                         {"steps", std::to_string(steps_of(request, from))},
                         {"solver", to_string(method_of(request, from))}};
  if (request.mix != 0) {
    provenance.settings.push_back({"to", std::to_string(request.to)});
    provenance.settings.push_back({"mix", std::format("{}", request.mix)});
  }
  return provenance;
}

std::string default_name(const Sampler& sampler, const SampleRequest& request) {
  const std::string seed = sampler.name + "_" + std::to_string(request.seed);
  return request.mix == 0 ? seed : std::format("{}_to_{}_{}", seed, request.to, request.mix);
}

// Completes the avatar and gives its package's bytes: golden frame by this device, budget, floats
// and integers as asked for.
Result<std::vector<std::byte>> pack(const SampleOptions& options, const LoadedPackage& sampler,
                                    const Package& body, Avatar avatar) {
  // On one thread, however many there are: the memory that the package states depends on them.
  const Result<GoldenPicture> picture = draw_golden_picture(
      avatar, body, options.precision == "f32" ? Precision::kFloat32 : Precision::kFixedPoint,
      {.threads = 1, .isa = options.renderer.isa});
  if (!picture.ok()) return picture.status();
  if (options.precision != "f32") {
    avatar.golden.fixed_point_hash = hash_picture(picture->frame.u8.pixels);
    avatar.golden.fixed_point_library = network_library();
  } else {
    avatar.fixed_point = {};
  }
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, true);
  if (!shapes.ok()) return shapes.status();
  const Budget budget{.peak_memory_bytes = picture->memory_bytes,
                      .macs_per_frame = count_macs(avatar.network, *shapes),
                      .gaussians = body.body().texel_count()};
  if (options.precision == "q8") {
    for (Layer& layer : avatar.network.layers) layer.weights = layer.bias = {};
  }
  return write_package(avatar, budget, provenance_of(sampler, options.request));
}

Result<SampleRequest> checked_request(const SampleOptions& options) {
  SampleRequest request = options.request;
  if (options.to.has_value() != options.mix.has_value()) {
    return Status(
        StatusCode::kInvalidArgument,
        "sample: --to and --mix go together: the seed to blend with, and how far to go (0 to 1)");
  }
  request.to = options.to.value_or(0), request.mix = options.mix.value_or(0);
  if (!options.solver.empty()) {
    request.method =
        options.solver == "ddim" ? SolverMethod::kDdim : SolverMethod::kDpmSolverPlusPlus2M;
  }
  return request;
}

// What a sampling came to.
struct Sampled {
  std::string name;
  std::array<uint64_t, 2> hash;  // of the weights
  uint64_t size_bytes = 0;
  double open_s = 0, sample_s = 0;
  uint64_t peak_bytes = 0;  // of the process when the weights were there, the package's mapped
                            // pages included
};

Status print_summary(const SampleOptions& options, const Sampler& from,
                     const AvatarSampler& sampler, const Sampled& sampled) {
  const uint32_t evaluations = steps_of(options.request, from);
  ports::say(std::format("{}: {}, {} evaluations in {:.2f} s, weights {}", options.output,
                         sampled.name, evaluations, sampled.sample_s, format_hash(sampled.hash)));
  nlohmann::ordered_json json = json_header("sample");
  json["sampler"] = options.sampler;
  json["output"] = options.output;
  json["seed"] = options.request.seed;
  if (options.request.mix != 0) json["to"] = options.request.to, json["mix"] = options.request.mix;
  json["solver"] = to_string(method_of(options.request, from));
  json["evaluations"] = evaluations;
  json["weights_hash"] = format_hash(sampled.hash);
  json["size_bytes"] = sampled.size_bytes;
  json["seconds"] = {{"open", sampled.open_s}, {"sample", sampled.sample_s}};
  json["macs_per_evaluation"] = sampler.macs_per_evaluation();
  json["sampler_memory_bytes"] = sampler.memory_bytes();
  json["peak_memory_bytes"] = sampled.peak_bytes;
  json["machine"] = json_sampling_machine(sampler.isa());
  return write_json(options.device.json, json);
}

Status run_sample(SampleOptions options) {
  if (!options.output.ends_with(".fgn"))
    return Status(StatusCode::kUnsupported, options.output + ": avatars are written as .fgn");
  const Result<SampleRequest> request = checked_request(options);
  if (!request.ok()) return request.status();
  options.request = *request;
  const Result<RendererOptions> renderer = options.device.renderer_options();
  if (!renderer.ok()) return renderer.status();
  options.renderer = *renderer;

  const uint64_t start_ns = ports::now_ns();
  const Result<std::unique_ptr<LoadedPackage>> loaded =
      load_package(options.sampler, PackageKind::kSampler);
  if (!loaded.ok()) return loaded.status();
  const Sampler& from = (*loaded)->package.sampler();
  const Result<std::unique_ptr<AvatarSampler>> sampler = AvatarSampler::create(from, renderer->isa);
  if (!sampler.ok()) return sampler.status().within(options.sampler);
  const uint64_t loaded_ns = ports::now_ns();

  SampledAvatar person;
  FIG_RETURN_IF_ERROR((*sampler)->sample(options.request, person).within(options.sampler));
  const uint64_t sampled_ns = ports::now_ns();
  const uint64_t peak_bytes = peak_memory_bytes();

  Avatar avatar = person.avatar();
  avatar.name = options.name.empty() ? default_name(from, options.request) : options.name;
  const Result<std::unique_ptr<LoadedPackage>> body =
      find_body(avatar, avatar.name, options.sampler, options.body);
  if (!body.ok()) return body.status();
  std::unique_ptr<Strip> strip;
  if (!options.trace.empty()) {
    const uint32_t steps = steps_of(options.request, from);
    Result<std::unique_ptr<Strip>> created =
        Strip::create(options.trace, from, (*body)->package, steps, *renderer);
    if (!created.ok()) return created.status();
    strip = std::move(*created);
    SampledAvatar again;  // the same person, watched
    FIG_RETURN_IF_ERROR(
        (*sampler)->sample(options.request, again, strip.get()).within(options.sampler));
  }
  const Result<std::vector<std::byte>> bytes = pack(options, **loaded, (*body)->package, avatar);
  if (!bytes.ok()) return bytes.status().within(options.output);
  FIG_RETURN_IF_ERROR(check_interrupt());
  FIG_RETURN_IF_ERROR(ports::write_file_atomically(options.output, *bytes));
  if (strip) FIG_RETURN_IF_ERROR(strip->finish());

  const auto seconds = [](uint64_t from_ns, uint64_t to_ns) {
    return static_cast<double>(to_ns - from_ns) * 1e-9;
  };
  return print_summary(options, from, **sampler,
                       {.name = avatar.name,
                        .hash = hash_weights(avatar.fixed_point, avatar.shape, avatar.static_part),
                        .size_bytes = bytes->size(),
                        .open_s = seconds(start_ns, loaded_ns),
                        .sample_s = seconds(loaded_ns, sampled_ns),
                        .peak_bytes = peak_bytes});
}

}  // namespace

Command add_sample_command(CLI::App& app) {
  auto options = std::make_shared<SampleOptions>();
  CLI::App* command = app.add_subcommand("sample", "Samples the weights of a new avatar");
  command->add_option("sampler", options->sampler, "sampler package (.fgn)")->required();
  command
      ->add_option("--seed", options->request.seed,
                   "the avatar's number: the same avatar on every device")
      ->required();
  command->add_option("--to", options->to, "second seed, to blend with");
  command->add_option("--mix", options->mix, "how far from --seed to --to, 0 to 1")
      ->check(ports::between(0.0, 1.0));
  command
      ->add_option("--steps", options->request.steps,
                   "evaluations of the denoiser; default: the sampler's")
      ->check(ports::between(1, kMaxSolverSteps));
  command
      ->add_option("--solver", options->solver,
                   "ddim is of first order, dpmpp2m of second; default: the sampler's")
      ->check(ports::one_of({"ddim", "dpmpp2m"}));
  command
      ->add_option("--precision", options->precision,
                   "arithmetic that the avatar is made for: fixed point, float weights, or both")
      ->check(ports::one_of({"q8", "f32", "f32,q8"}))
      ->capture_default_str();
  add_body_option(*command, options->body);
  command->add_option("--name", options->name,
                      "of the avatar; default: the sampler's name and the seed");
  command->add_option(
      "--trace", options->trace,
      "folder: a picture of the avatar after every step, and strip.png of ten of them");
  command->add_option("-o,--output", options->output, "avatar package to write (.fgn)")->required();
  options->device.add_to(*command, {.precision = true});  // it has one of its own
  return {command, [options] { return run_sample(*options); }};
}

}  // namespace figurine::samples
