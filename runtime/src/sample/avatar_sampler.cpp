#include "figurine/avatar_sampler.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <string>
#include <utility>

#include "figurine/detail/double_math.h"
#include "runtime/src/base/content_bytes.h"
#include "runtime/src/base/float_mode.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/kernels/table.h"
#include "runtime/src/sample/device_transformer.h"
#include "runtime/src/sample/noise.h"
#include "runtime/src/sample/solver.h"
#include "runtime/src/sample/weight_decoder.h"

namespace figurine {

namespace {

constexpr uint64_t kWeightsStream = 0;  // of a seed's random numbers

Status invalid(const std::string& what) {
  return Status(StatusCode::kInvalidArgument, "sampling: " + what);
}

}  // namespace

struct AvatarSampler::Impl {
  explicit Impl(const Sampler& from) : sampler(from) {}

  const Sampler sampler;  // a copy: its arrays alone are borrowed
  Isa isa = Isa::kBaseline;
  NoiseSchedule schedule;
  std::unique_ptr<DeviceTransformer> transformer;
  std::vector<NoiseLevel> levels;
  Buffer<double> z, x0, previous_x0;  // [D]
  Buffer<float> noisy, clean;         // [D]

  bool allocate() {
    const size_t size = sampler.direction_scale.size();
    return z.ensure(size) && x0.ensure(size) && previous_x0.ensure(size) && noisy.ensure(size) &&
           clean.ensure(size);
  }

  // Of a sample, with room for so many weights and integers: all that it is stored in.
  size_t sample_bytes(size_t weights, size_t integers) const {
    size_t static_integers = 0;
    for (const SampledStaticGroup& group : sampler.static_groups)
      static_integers += group.row.size() * group.channels;
    return content_bytes(sampler) + (kMaxSolverSteps + 1) * sizeof(NoiseLevel) +
           (weights < sampler.mean.size() ? sampler.mean.size() * sizeof(float) : 0) +
           (integers < static_integers ? static_integers : 0) +
           (sampler.shares_network ? 0 : sampler.mean.size() * sizeof(int8_t));
  }

  // The start: standard normal, whatever the mix.
  void fill_start(const SampleRequest& request) {
    const size_t size = sampler.direction_scale.size();
    fill_normal(request.seed, kWeightsStream, noisy.span(size));
    for (size_t k = 0; k < size; ++k) z[k] = double{noisy[k]};
    if (request.mix == 0) return;
    const SineCosine share = sine_cosine_of_turns(request.mix / 4);
    fill_normal(request.to, kWeightsStream, noisy.span(size));
    for (size_t k = 0; k < size; ++k) z[k] = share.cosine * z[k] + share.sine * double{noisy[k]};
  }

  // Values [D] to an avatar in float and in fixed point.
  Status decode(std::span<const double> values, std::vector<float>& weights,
                std::vector<int8_t>& integers, FixedPointStorage& fixed_point,
                Avatar& avatar) const {
    weights.resize(sampler.mean.size());
    decode_weights(sampler, values, weights);
    for (const float weight : weights) {
      if (!std::isfinite(weight))
        return Status(StatusCode::kCorrupt, "sampling: a weight is not finite");
    }
    avatar.kind() = sampler.kind();
    avatar.traits() = sampler.traits();
    avatar.name = sampler.name;
    avatar.uv_size = sampler.uv_size;
    avatar.antialiased = sampler.antialiased;
    avatar.pose_statistics = sampler.pose_statistics;
    std::span<const float> rest = weights;
    const std::vector<size_t> sizes = sampler_token_sizes(sampler);
    size_t token = 0;
    for (Layer& layer : avatar.network.layers) {
      if (layer.op != LayerOp::kConv2d || sampler.shares_network) continue;
      const size_t kernel = sizes[token++] - layer.out_channels;
      layer.weights = rest.first(kernel);
      layer.bias = rest.subspan(kernel, layer.out_channels);
      rest = rest.subspan(kernel + layer.out_channels);
    }
    avatar.shape = rest.first(sampler.shape_count);
    avatar.static_part = decode_static_part(sampler, rest.subspan(sampler.shape_count), integers);
    if (sampler.shares_network) {
      avatar.fixed_point = sampler.fixed_point;
      return {};
    }
    FIG_RETURN_IF_ERROR(fixed_point.quantise(avatar.network, sampler.values));
    avatar.fixed_point = fixed_point.view();
    return {};
  }
};

namespace {

// The transformer as the solver wants it, and the trace as it wants to be told.
class Predictor final : public Denoiser<double> {
 public:
  Predictor(DeviceTransformer& transformer, const NoiseSchedule& schedule, std::span<float> noisy,
            std::span<float> clean)
      : transformer_(transformer),
        noisiest_(schedule.lambda(0)),
        cleanest_(schedule.lambda(1)),
        noisy_(noisy),
        clean_(clean) {}

  Status traced;  // an error of the trace ends the run at the next prediction

  Status predict(std::span<const double> z, const NoiseLevel& level, size_t,
                 std::span<double> x0) override {
    FIG_RETURN_IF_ERROR(traced);
    for (size_t k = 0; k < z.size(); ++k) noisy_[k] = static_cast<float>(z[k]);
    // Pure noise is told as the noisiest level that was trained: they differ by a D x SNR of a
    // tenth.
    transformer_.predict(noisy_, std::clamp(level.lambda, noisiest_, cleanest_), clean_);
    for (size_t k = 0; k < z.size(); ++k) x0[k] = double{clean_[k]};
    return {};
  }

 private:
  DeviceTransformer& transformer_;
  double noisiest_, cleanest_;
  std::span<float> noisy_, clean_;
};

template <class Show>
class Watcher final : public SolverTrace<double> {
 public:
  explicit Watcher(Show show) : show_(std::move(show)) {}
  void after_step(size_t step, const NoiseLevel& level, std::span<const double>,
                  std::span<const double> x0) override {
    show_(step, level, x0);
  }

 private:
  Show show_;
};

}  // namespace

AvatarSampler::AvatarSampler(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AvatarSampler::~AvatarSampler() = default;

Result<std::unique_ptr<AvatarSampler>> AvatarSampler::create(const Sampler& sampler,
                                                             std::optional<Isa> isa) {
  const FloatModeScope mode(FloatMode::exact());
  const MemoryReserve reserve(content_bytes(sampler));
  if (!reserve.held()) return no_memory();
  const Result<const KernelTable*> kernels = kernels_for(isa.value_or(supported_isas().back()));
  if (!kernels.ok()) return kernels.status();
  std::unique_ptr<Impl> impl(new (std::nothrow) Impl(sampler));
  if (impl == nullptr || !impl->allocate()) return out_of_memory("the sampler");
  Result<NoiseSchedule> schedule = NoiseSchedule::create(sampler.noise);
  if (!schedule.ok()) return schedule.status();
  impl->schedule = *schedule;
  Result<std::unique_ptr<DeviceTransformer>> transformer =
      DeviceTransformer::create(impl->sampler, **kernels);
  if (!transformer.ok()) return transformer.status();
  impl->transformer = std::move(*transformer);
  impl->isa = (*kernels)->isa;
  std::unique_ptr<AvatarSampler> made(new (std::nothrow) AvatarSampler(std::move(impl)));
  if (made == nullptr) return out_of_memory("the sampler");
  return made;
}

Status AvatarSampler::sample(const SampleRequest& request, SampledAvatar& out, Trace* trace) {
  // Weights are data, of which denormals are a part; they were trained and hashed with them.
  const FloatModeScope mode(FloatMode::exact());
  Impl& impl = *impl_;
  const MemoryReserve reserve(impl.sample_bytes(out.weights_.capacity(), out.integers_.capacity()));
  if (!reserve.held()) return no_memory();
  const uint32_t steps = request.steps == 0 ? impl.sampler.steps : request.steps;
  if (steps > kMaxSolverSteps)
    return invalid("steps " + std::to_string(steps) + " are more than " +
                   std::to_string(kMaxSolverSteps));
  if (!(request.mix >= 0 && request.mix <= 1)) return invalid("the mix is not within 0 and 1");
  const size_t size = impl.sampler.direction_scale.size();
  impl.levels.resize(size_t{steps} + 1);
  solver_levels(impl.schedule, true, impl.levels);
  impl.fill_start(request);

  Predictor predictor(*impl.transformer, impl.schedule, impl.noisy.span(size),
                      impl.clean.span(size));
  Watcher watcher([&](size_t step, const NoiseLevel& level, std::span<const double> x0) {
    if (trace == nullptr || !predictor.traced.ok()) return;
    predictor.traced = impl.decode(x0, out.weights_, out.integers_, out.fixed_point_, out.avatar_);
    if (predictor.traced.ok())
      predictor.traced = trace->after_step(static_cast<uint32_t>(step) + 1, level.lambda, out);
  });
  const SolverOptions options{.method = request.method.value_or(impl.sampler.method)};
  const SolverStorage<double> storage{impl.x0.span(size), impl.previous_x0.span(size)};
  FIG_RETURN_IF_ERROR(solve<double>(options, impl.levels, predictor, storage, impl.z.span(size),
                                    trace == nullptr ? nullptr : &watcher));
  FIG_RETURN_IF_ERROR(predictor.traced);
  return impl.decode(impl.z.span(size), out.weights_, out.integers_, out.fixed_point_, out.avatar_);
}

Isa AvatarSampler::isa() const { return impl_->isa; }

uint64_t AvatarSampler::memory_bytes() const {
  return impl_->z.memory_bytes() + impl_->x0.memory_bytes() + impl_->previous_x0.memory_bytes() +
         impl_->noisy.memory_bytes() + impl_->clean.memory_bytes() +
         impl_->transformer->memory_bytes() + impl_->levels.capacity() * sizeof(NoiseLevel);
}

uint64_t AvatarSampler::macs_per_evaluation() const {
  const Sampler& sampler = impl_->sampler;
  const uint64_t tokens = sampler.ranks.size() + 1, d = sampler.denoiser.d_model;
  uint64_t macs = 0;
  const std::vector<MatrixShape> matrices = denoiser_matrices(sampler.denoiser, sampler.ranks);
  const size_t first = sampler.ranks.size() + 2, last = first + size_t{4} * sampler.denoiser.blocks;
  for (size_t i = 0; i < matrices.size(); ++i) {
    macs +=
        uint64_t{matrices[i].rows} * matrices[i].columns * (i >= first && i < last ? tokens : 1);
  }
  return macs + sampler.denoiser.blocks * 2 * tokens * tokens * d;
}

}  // namespace figurine
