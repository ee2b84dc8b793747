// Samplers and sampled avatars of figurine.h.
#include "runtime/src/c/c_sampler.h"

#include <algorithm>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include "runtime/src/c/isa.h"
#include "runtime/src/c/report.h"
#include "runtime/src/c/structs.h"

namespace figurine::c {
namespace {

struct SamplerObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kSampler;
  Pin<PackageObject> package;  // in front of what borrows from it
  std::unique_ptr<AvatarSampler> sampler;
};

Result<SampleRequest> request_of(const fig_sample_options& options) {
  SampleRequest request{
      .seed = options.seed, .to = options.to, .mix = options.mix, .steps = options.steps};
  if (options.solver > FIG_SOLVER_DPMPP2M)
    return invalid("solver: " + std::to_string(static_cast<int>(options.solver)) + " is none");
  if (options.solver == FIG_SOLVER_DDIM) request.method = SolverMethod::kDdim;
  if (options.solver == FIG_SOLVER_DPMPP2M) request.method = SolverMethod::kDpmSolverPlusPlus2M;
  return request;
}

// The layer of convolution i, counted without the other operators.
Result<size_t> layer_of(const Network& network, uint32_t i) {
  uint32_t count = 0;
  for (size_t layer = 0; layer < network.layers.size(); ++layer) {
    if (network.layers[layer].op == LayerOp::kConv2d && count++ == i) return layer;
  }
  return invalid("convolution " + std::to_string(i) + ": there are " + std::to_string(count) +
                 ", from 0");
}

}  // namespace
}  // namespace figurine::c

using namespace figurine;
using namespace figurine::c;

static fig_sampler_options default_sampler_options() {
  return {.struct_bytes = sizeof(fig_sampler_options), .isa = FIG_ISA_BEST};
}
void fig_set_default_sampler_options(fig_sampler_options* value, size_t struct_bytes) {
  set_default(default_sampler_options(), value, struct_bytes);
}

static fig_sample_options default_sample_options() {
  return {.struct_bytes = sizeof(fig_sample_options),
          .seed = 0,
          .to = 0,
          .mix = 0,
          .steps = 0,
          .solver = FIG_SOLVER_DEFAULT};
}
void fig_set_default_sample_options(fig_sample_options* value, size_t struct_bytes) {
  set_default(default_sample_options(), value, struct_bytes);
}

static fig_sampled_info default_sampled_info() {
  fig_sampled_info info{};
  info.struct_bytes = sizeof info;
  return info;
}
void fig_set_default_sampled_info(fig_sampled_info* value, size_t struct_bytes) {
  set_default(default_sampled_info(), value, struct_bytes);
}

static fig_convolution default_convolution() {
  fig_convolution convolution{};
  convolution.struct_bytes = sizeof convolution;
  return convolution;
}
void fig_set_default_convolution(fig_convolution* value, size_t struct_bytes) {
  set_default(default_convolution(), value, struct_bytes);
}

fig_status fig_sampler_create(fig_package package, const fig_sampler_options* options,
                              fig_sampler* sampler) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(sampler, "sampler"));
  *sampler = {0};
  fig_sampler_options read = fig_default_sampler_options();
  FIG_REPORT_IF_ERROR(read_options(options, "sampler options", read));
  const Result<std::optional<Isa>> isa = isa_of(read.isa);
  if (!isa.ok()) return report(isa.status());
  Result<Pin<PackageObject>> pinned = handles().pin<PackageObject>(package.id);
  if (!pinned.ok()) return report(pinned.status());
  FIG_REPORT_IF_ERROR(check_kind((*pinned)->package, PackageKind::kSampler));
  Result<std::unique_ptr<AvatarSampler>> created =
      AvatarSampler::create((*pinned)->package.sampler(), *isa);
  if (!created.ok()) return report(created.status());
  std::unique_ptr<SamplerObject> object(new (std::nothrow) SamplerObject);
  if (object == nullptr) return report(out_of_memory("a sampler"));
  object->package = std::move(*pinned);
  object->sampler = std::move(*created);
  const Result<uint64_t> handle = handles().add(std::move(object));
  if (!handle.ok()) return report(handle.status());
  sampler->id = *handle;
  return FIG_OK;
}

fig_status fig_sampler_destroy(fig_sampler sampler) {
  const MemoryReserve messages;
  return report(handles().remove<SamplerObject>(sampler.id).status());
}

fig_status fig_sampler_sample(fig_sampler sampler, const fig_sample_options* options,
                              fig_sampled* sampled) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(sampled, "sampled avatar"));
  *sampled = {0};
  fig_sample_options read = fig_default_sample_options();
  FIG_REPORT_IF_ERROR(read_options(options, "sample options", read));
  const Result<SampleRequest> request = request_of(read);
  if (!request.ok()) return report(request.status());
  const Result<Pin<SamplerObject>> pinned =
      handles().pin<SamplerObject>(sampler.id, Use::kExclusive);
  if (!pinned.ok()) return report(pinned.status());
  std::unique_ptr<SampledObject> object(new (std::nothrow) SampledObject);
  if (object == nullptr) return report(out_of_memory("a sampled avatar"));
  FIG_REPORT_IF_ERROR((*pinned)->sampler->sample(*request, object->sampled));
  object->package = (*pinned)->package.share();
  const Result<uint64_t> handle = handles().add(std::move(object));
  if (!handle.ok()) return report(handle.status());
  sampled->id = *handle;
  return FIG_OK;
}

fig_status fig_sampled_destroy(fig_sampled sampled) {
  const MemoryReserve messages;
  return report(handles().remove<SampledObject>(sampled.id).status());
}

fig_status fig_sampled_get_info(fig_sampled sampled, fig_sampled_info* info) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(info, "sampled info"));
  const Result<Pin<SampledObject>> pinned = handles().pin<SampledObject>(sampled.id);
  if (!pinned.ok()) return report(pinned.status());
  const Avatar& avatar = (*pinned)->sampled.avatar();
  fig_sampled_info whole = fig_default_sampled_info();
  whole.convolution_count = static_cast<uint32_t>(
      std::count_if(avatar.network.layers.begin(), avatar.network.layers.end(),
                    [](const Layer& layer) { return layer.op == LayerOp::kConv2d; }));
  whole.shape_count = static_cast<uint32_t>(avatar.shape.size());
  whole.shape = avatar.shape.data();
  const std::array<uint64_t, 2> hash =
      hash_weights(avatar.fixed_point, avatar.shape, avatar.static_part);
  std::copy(hash.begin(), hash.end(), whole.weights_hash);
  fill_struct(whole, info);
  return FIG_OK;
}

fig_status fig_sampled_convolution(fig_sampled sampled, uint32_t convolution,
                                   fig_convolution* info) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(info, "convolution"));
  const Result<Pin<SampledObject>> pinned = handles().pin<SampledObject>(sampled.id);
  if (!pinned.ok()) return report(pinned.status());
  const Avatar& avatar = (*pinned)->sampled.avatar();
  const Result<size_t> place = layer_of(avatar.network, convolution);
  if (!place.ok()) return report(place.status());
  const Layer& layer = avatar.network.layers[*place];
  const FixedPointConvolution& fixed = avatar.fixed_point.convolutions[*place];
  fig_convolution whole = fig_default_convolution();
  whole.out_channels = layer.out_channels;
  whole.kernel = layer.kernel;
  whole.in_channels = static_cast<uint32_t>(layer.weights.size() / layer.out_channels /
                                            (size_t{layer.kernel} * layer.kernel));
  whole.weights = layer.weights.data();
  whole.bias = layer.bias.data();
  whole.q8_weights = fixed.weights.data();
  whole.q8_scale = fixed.weight_scale.data();
  whole.q8_bias = fixed.bias.data();
  fill_struct(whole, info);
  return FIG_OK;
}
