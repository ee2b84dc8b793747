#include "samples/figurine/sampler_report.h"

#include <algorithm>
#include <cmath>
#include <format>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "figurine/renderer.h"
#include "ports/host/clock.h"
#include "ports/media/png.h"
#include "samples/common/device_options.h"
#include "samples/common/frame_log.h"
#include "samples/common/image_error.h"
#include "samples/common/progress.h"
#include "samples/common/rendered_frame.h"
#include "samples/figurine/report_files.h"
#include "samples/figurine/report_page.h"

namespace figurine::samples {

namespace {

using Json = nlohmann::ordered_json;

constexpr uint32_t kReferenceEvaluations = 500;
constexpr uint32_t kEvaluations[] = {1, 2, 3, 5, 10, 20, 50, 100, 250};
constexpr uint32_t kShown[] = {1, 2, 5, 10, 20};  // in the page's pictures

struct Solver {
  SolverMethod method;
  const char* meaning;
  double order;
  const char* theory;
};
constexpr Solver kSolvers[] = {
    {SolverMethod::kDpmSolverPlusPlus2M,
     "steps of DPM-Solver++(2M), each with one evaluation of the denoiser", 2,
     "Two predictions make a straight line in lambda of what the denoiser believes: the error "
     "falls with the square of the step."},
    {SolverMethod::kDdim, "steps of DDIM, each with one evaluation of the denoiser", 1,
     "One prediction is held over the step: the error falls with the step."}};

struct SolverSetting {
  ErrorSum error;
  std::vector<double> ms;
};

// A person in the golden pose, drawn from its float weights: the rounding to int8 would hide how
// the error falls.
class PersonRenderer {
 public:
  static Result<std::unique_ptr<PersonRenderer>> create(const LoadedPackage& package,
                                                        const SamplerReportOptions& options) {
    const Sampler& sampler = package.package.sampler();
    auto made = std::make_unique<PersonRenderer>();
    Result<std::unique_ptr<AvatarSampler>> device = AvatarSampler::create(sampler, options.isa);
    if (!device.ok()) return device.status().within(package.path);
    made->sampler_ = std::move(*device);
    made->golden_ = sampler.golden;
    SampledAvatar person;
    FIG_RETURN_IF_ERROR(
        made->sampler_->sample({.seed = 0, .steps = 1}, person).within(package.path));
    Result<std::unique_ptr<LoadedPackage>> body =
        find_body(person.avatar(), package.path, package.path, options.body);
    if (!body.ok()) return body.status();
    made->body_ = std::move(*body);
    return made;
  }

  // ms: of the sampling alone.
  Result<ports::ImageF32> draw(const SampleRequest& request, double* ms) {
    SampledAvatar person;
    const uint64_t start_ns = ports::now_ns();
    FIG_RETURN_IF_ERROR(sampler_->sample(request, person));
    if (ms != nullptr) *ms = static_cast<double>(ports::now_ns() - start_ns) * 1e-6;
    Result<std::unique_ptr<Renderer>> renderer =
        Renderer::create({.threads = 1, .isa = sampler_->isa()});
    if (!renderer.ok()) return renderer.status();
    const Result<AvatarId> id =
        (*renderer)->add_avatar(person.avatar(), body_->package, Precision::kFloat32);
    if (!id.ok()) return id.status();
    RenderedFrame frame({golden_.camera.width_px, golden_.camera.height_px}, PixelFormat::kRgbaF32);
    const FrameAvatar posed[] = {
        {.avatar = *id, .pose = {golden_.root_translation_m, golden_.rotations}}};
    FIG_RETURN_IF_ERROR(
        (*renderer)->render({.camera = golden_.camera, .avatars = posed}, frame.target()));
    return std::move(frame.f32);
  }

  const AvatarSampler& sampler() const { return *sampler_; }
  const GoldenFrame& golden() const { return golden_; }

 private:
  std::unique_ptr<AvatarSampler> sampler_;
  std::unique_ptr<LoadedPackage> body_;
  GoldenFrame golden_;
};

Result<ReportPicture> shown(const std::string& caption, const ports::ImageF32& picture) {
  ports::ImageU8 image(picture.width_px, picture.height_px, 3);
  for (uint32_t y = 0; y < picture.height_px; ++y) {
    for (uint32_t x = 0; x < picture.width_px; ++x) {
      const float* p = picture.at(x, y);
      for (int c = 0; c < 3; ++c) {
        const float value = 0.5f + (p[c] - 0.5f) * p[3];
        image.at(x, y)[c] = static_cast<uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255));
      }
    }
  }
  Result<std::vector<std::byte>> png = ports::encode_png(image);
  if (!png.ok()) return png.status();
  return ReportPicture{caption, std::move(*png)};
}

// Slope of log error over log step between two settings, coarse and fine.
double order_between(const std::vector<SolverSetting>& settings, size_t coarse, size_t fine) {
  return std::log(settings[coarse].error.rmse() / settings[fine].error.rmse()) /
         std::log(double(kEvaluations[fine]) / kEvaluations[coarse]);
}

// What more evaluations do not buy: the integers' rounding, and the reference's own error. The
// smallest error that any setting of any solver reaches.
double noise_floor(const std::vector<std::vector<SolverSetting>>& solvers) {
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<SolverSetting>& settings : solvers) {
    for (const SolverSetting& setting : settings) least = std::min(least, setting.error.rmse());
  }
  return least;
}

// Settings [first, last] over which a solver's order can be observed: the three finest whose error
// is at least four times the floor, which is then 3 % of it. Coarser ones have steps too large for
// the theory. None where fewer are above the floor.
std::optional<std::pair<size_t, size_t>> observable(const std::vector<SolverSetting>& settings,
                                                    double floor) {
  constexpr double kAboveFloor = 4;
  constexpr size_t kSettings = 3;
  size_t end = settings.size();
  while (end > 0 && !(settings[end - 1].error.rmse() > kAboveFloor * floor)) --end;
  if (end < kSettings) return std::nullopt;
  return std::pair(end - kSettings, end - 1);
}

Json dial_json(const Solver& solver, const Sampler& sampler, uint64_t macs,
               const std::vector<SolverSetting>& settings, double floor) {
  Json json = {{"name", std::string("step of ") + to_string(solver.method)},
               {"meaning", solver.meaning},
               {"theoretical_order", solver.order},
               {"theory", solver.theory},
               {"observed_order", nullptr},
               {"observed_over", nullptr},
               {"noise_floor", floor},
               {"stages", {"sampling"}},
               {"settings", Json::array()}};
  for (size_t s = 0; s < settings.size(); ++s) {
    const SolverSetting& setting = settings[s];
    Json row = {{"label", std::to_string(kEvaluations[s])},
                {"value", 1.0 / kEvaluations[s]},
                {"default", solver.method == sampler.method && kEvaluations[s] == sampler.steps},
                {"psnr_db", finite_or_null(setting.error.psnr_db())},
                {"rmse", setting.error.rmse()},
                {"largest", setting.error.largest},
                {"observed_order", nullptr}};
    if (s > 0 && setting.error.squared > 0 && settings[s - 1].error.squared > 0)
      row["observed_order"] = order_between(settings, s - 1, s);
    const Summary cost_ms = summarise(setting.ms);
    row["cost_ms"] = {{"median", cost_ms.median}, {"p90", cost_ms.p90}};
    row["work"] = {{"evaluations", kEvaluations[s]}, {"macs", macs * kEvaluations[s]}};
    json["settings"].push_back(std::move(row));
  }
  if (const auto range = observable(settings, floor)) {
    const auto [first, last] = *range;
    json["observed_order"] = order_between(settings, first, last);
    json["observed_over"] = std::format("{} to {} evaluations, above the noise floor of {:.1e}",
                                        kEvaluations[first], kEvaluations[last], floor);
  }
  return json;
}

}  // namespace

Status run_sampler_report(const LoadedPackage& package, const SamplerReportOptions& options) {
  const Sampler& sampler = package.package.sampler();
  Result<std::unique_ptr<PersonRenderer>> made = PersonRenderer::create(package, options);
  if (!made.ok()) return made.status();
  PersonRenderer& people = **made;
  std::vector<std::vector<SolverSetting>> settings(
      std::size(kSolvers), std::vector<SolverSetting>(std::size(kEvaluations)));
  std::vector<ReportPicture> pictures;
  Progress progress("report", options.seeds * std::size(kSolvers) * std::size(kEvaluations));
  uint64_t done = 0;
  for (uint64_t seed = 0; seed < options.seeds; ++seed) {
    const Result<ports::ImageF32> truth =
        people.draw({.seed = seed, .steps = kReferenceEvaluations}, nullptr);
    if (!truth.ok()) return truth.status();
    for (size_t s = 0; s < std::size(kEvaluations); ++s) {
      for (size_t m = 0; m < std::size(kSolvers); ++m) {
        FIG_RETURN_IF_ERROR(check_interrupt());
        double ms = 0;
        const Result<ports::ImageF32> picture = people.draw(
            {.seed = seed, .steps = kEvaluations[s], .method = kSolvers[m].method}, &ms);
        if (!picture.ok()) return picture.status();
        add_foreground_error(*truth, *picture, settings[m][s].error);
        settings[m][s].ms.push_back(ms);
        if (seed == 0 && m == 0 &&
            std::find(std::begin(kShown), std::end(kShown), kEvaluations[s]) != std::end(kShown)) {
          Result<ReportPicture> one =
              shown("seed 0 in " + std::to_string(kEvaluations[s]) + " evaluations", *picture);
          if (!one.ok()) return one.status();
          pictures.push_back(std::move(*one));
        }
        progress.update(++done);
      }
    }
    if (seed == 0) {
      Result<ReportPicture> one = shown("seed 0, the reference", *truth);
      if (!one.ok()) return one.status();
      pictures.push_back(std::move(*one));
    }
  }

  Json json = json_header("report");
  json["date"] = ports::date_utc();
  json["machine"] = json_sampling_machine(people.sampler().isa());
  json["sampler"] = package.path;
  json["seeds"] = options.seeds;
  json["size"] = {people.golden().camera.width_px, people.golden().camera.height_px};
  json["reference"] = {
      {"evaluations", kReferenceEvaluations},
      {"meaning", "the same seeds in 500 evaluations of DPM-Solver++(2M) by the same integers"}};
  json["metric"] =
      "PSNR of the sampled people in the golden pose, drawn from float weights, over pixels whose "
      "alpha in the reference exceeds 0.5, on "
      "stored "
      "sRGB values over mid-grey, squared errors pooled over all seeds; largest is the largest "
      "difference of one value there";
  json["timing"] =
      "median over the seeds of one sampling, noise to weights in integers; solvers take turns";
  json["dials"] = Json::array();
  const double floor = noise_floor(settings);
  for (size_t m = 0; m < std::size(kSolvers); ++m) {
    json["dials"].push_back(dial_json(kSolvers[m], sampler, people.sampler().macs_per_evaluation(),
                                      settings[m], floor));
  }
  FIG_RETURN_IF_ERROR(write_report(options.output, json, report_html(json, pictures)));
  FIG_RETURN_IF_ERROR(write_json(options.json, json));
  return {};
}

}  // namespace figurine::samples
