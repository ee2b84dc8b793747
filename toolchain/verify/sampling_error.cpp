#include "toolchain/verify/sampling_error.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "figurine/avatar_sampler.h"
#include "runtime/src/sample/device_transformer.h"
#include "toolchain/error.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/progress.h"
#include "toolchain/verify/device_avatar.h"
#include "toolchain/verify/float_sampler.h"

namespace figurine::verify {

using generate::RowMatrix;

namespace {

constexpr SolverMethod kMethods[] = {SolverMethod::kDdim, SolverMethod::kDpmSolverPlusPlus2M};
constexpr uint32_t kOrderFrom = 50,
                   kOrderTo = 250;  // evaluations between which the slope is observed

// The device's integers as the solver wants them, vector after vector.
class IntegerDenoiser final : public Denoiser<double> {
 public:
  IntegerDenoiser(DeviceTransformer& transformer, const NoiseSchedule& noise, size_t dimension)
      : transformer_(transformer), noise_(noise), in_(dimension), out_(dimension) {}
  Status predict(std::span<const double> z, const NoiseLevel& level, size_t,
                 std::span<double> x0) override {
    for (size_t begin = 0; begin < z.size(); begin += in_.size()) {
      for (size_t k = 0; k < in_.size(); ++k) in_[k] = static_cast<float>(z[begin + k]);
      transformer_.predict(in_, std::clamp(level.lambda, noise_.lambda(0), noise_.lambda(1)), out_);
      for (size_t k = 0; k < in_.size(); ++k) x0[begin + k] = double{out_[k]};
    }
    return {};
  }

 private:
  DeviceTransformer& transformer_;
  NoiseSchedule noise_;
  std::vector<float> in_, out_;
};

double rms(const RowMatrix& a, const RowMatrix& b) {
  return std::sqrt((a - b).squaredNorm() / static_cast<double>(a.size()));
}

// A denoiser under both solvers.
struct Case {
  const char* name;
  Denoiser<double>* denoiser;
  RowMatrix exact;
};

std::vector<measure::Picture> portraits(const Sampler& sampler, const Package& body,
                                        const SampleRequest& base, size_t seeds) {
  const std::unique_ptr<AvatarSampler> device =
      value_or_throw(AvatarSampler::create(sampler), sampler.name);
  std::vector<measure::Picture> pictures;
  SampledAvatar person;
  for (uint64_t seed = 0; seed < seeds; ++seed) {
    SampleRequest request = base;
    request.seed = seed;
    throw_if_error(device->sample(request, person), sampler.name);
    DeviceAvatar avatar(person.avatar(), body);
    avatar.pose({sampler.golden.root_translation_m, sampler.golden.rotations});
    pictures.push_back(avatar.draw(sampler.golden.camera));
  }
  return pictures;
}

}  // namespace

nlohmann::json measure_sampling_error(const generate::TrainedSampler& trained,
                                      const Sampler& sampler, const Package& body,
                                      const SamplingErrorOptions& options) {
  const generate::ModelSpace& space = *trained.space;
  const NoiseSchedule noise = generate::noise_schedule(trained.settings, space.dimension());
  if (sampler.direction_scale.size() != space.size())
    throw InputError("sampler '" + sampler.name + "': is another run's");
  const generate::MemberOracle members(trained.training);
  const std::unique_ptr<DeviceTransformer> device =
      value_or_throw(DeviceTransformer::create(sampler), sampler.name);
  OracleDenoiser oracle(members, options.seeds);
  TransformerDenoiser network(*trained.transformer, noise, options.seeds);
  IntegerDenoiser integers(*device, noise, space.size());
  Case cases[] = {{"oracle, float64", &oracle, {}},
                  {"network, float32", &network, {}},
                  {"network, int8", &integers, {}}};

  train::Progress progress("sampling", options.quiet);
  const train::InterruptGuard interrupt;
  const double steps_in_all = 3.0 * static_cast<double>(1 + 2 * options.evaluations.size());
  double step = 0;
  const auto draw = [&](Denoiser<double>& denoiser, uint32_t evaluations, SolverMethod method) {
    progress.show(step++ / steps_in_all, std::to_string(evaluations) + " evaluations");
    if (interrupt.requested())
      throw train::Interrupted("sampling: interrupted, nothing was written");
    return draw_vectors(denoiser, noise, space.size(),
                        {.count = options.seeds, .steps = evaluations, .method = method});
  };

  nlohmann::json rows = nlohmann::json::array(), orders;
  for (Case& one : cases)
    one.exact =
        draw(*one.denoiser, options.reference_evaluations, SolverMethod::kDpmSolverPlusPlus2M);
  const std::vector<measure::Picture> exact_pictures = portraits(
      sampler, body,
      {.steps = options.reference_evaluations, .method = SolverMethod::kDpmSolverPlusPlus2M},
      options.seeds);
  for (const Case& one : cases) {
    const bool is_device = one.denoiser == &integers;
    for (const SolverMethod method : kMethods) {
      double from = 0, to = 0;
      for (const uint32_t evaluations : options.evaluations) {
        const auto start = std::chrono::steady_clock::now();
        const RowMatrix drawn = draw(*one.denoiser, evaluations, method);
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        const double error = rms(drawn, one.exact);
        nlohmann::json row{{"denoiser", one.name},
                           {"solver", to_string(method)},
                           {"evaluations", evaluations},
                           {"rms_error", error},
                           {"seconds", seconds / static_cast<double>(options.seeds)}};
        if (is_device) {
          row["float_rms_error"] = rms(drawn, cases[1].exact);
          const std::vector<measure::Picture> pictures =
              portraits(sampler, body, {.steps = evaluations, .method = method}, options.seeds);
          const double psnr_db = measure::union_error(pictures, exact_pictures).psnr_db();
          row["picture_db"] = std::isfinite(psnr_db)
                                  ? nlohmann::json(psnr_db)
                                  : nlohmann::json();  // null: the same to the bit
        }
        rows.push_back(std::move(row));
        if (evaluations == kOrderFrom) from = error;
        if (evaluations == kOrderTo) to = error;
      }
      if (from > 0 && to > 0)
        orders[one.name][to_string(method)] =
            std::log(from / to) / std::log(double{kOrderTo} / kOrderFrom);
    }
  }
  return {{"seeds", options.seeds},
          {"dimension", space.size()},
          {"reference_evaluations", options.reference_evaluations},
          {"order_between_evaluations", {kOrderFrom, kOrderTo}},
          {"order", orders},
          {"floor", {{"rms_error_of_integers", rms(cases[2].exact, cases[1].exact)}}},
          {"rows", rows}};
}

}  // namespace figurine::verify
