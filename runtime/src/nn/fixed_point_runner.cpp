#include "runtime/src/nn/fixed_point_runner.h"

#include <algorithm>
#include <deque>
#include <new>

#include "runtime/src/nn/xnnpack_graph.h"

namespace figurine {
namespace {

constexpr size_t kGroupsPerTask = 16;

bool is_first(const Layer& layer) { return layer.op == LayerOp::kConv2d && layer.inputs[0] == 0; }

class FixedPointGraphBuilder : public GraphBuilder {
 public:
  FixedPointGraphBuilder(const Network& network, const std::vector<ValueShape>& shapes,
                         const GraphPlan& plan, const FixedPointNetwork& fixed)
      : GraphBuilder(network, shapes, plan), fixed_(fixed) {}

 private:
  Status reserve_copies() override {
    size_t size_bytes = 0;
    for (const FixedPointConvolution& convolution : fixed_.convolutions) {
      size_bytes += PaddedCopies::padded(convolution.weights.size_bytes()) +
                    PaddedCopies::padded(convolution.bias.size_bytes());
    }
    return copies().reserve(size_bytes) ? Status() : out_of_memory("the network's weights");
  }

  xnn_status define_value(size_t value, const size_t (&dims)[4], uint32_t external_id,
                          uint32_t flags, uint32_t& id) override {
    const Quantisation& quantisation = fixed_.values[value];
    return xnn_define_quantized_tensor_value(subgraph(), xnn_datatype_qint8,
                                             quantisation.zero_point, quantisation.scale, 4, dims,
                                             nullptr, external_id, flags, &id);
  }
  xnn_status define_weights(size_t layer, const size_t (&dims)[4], uint32_t& id) override {
    const FixedPointConvolution& convolution = fixed_.convolutions[layer];
    return xnn_define_channelwise_quantized_tensor_value(
        subgraph(), xnn_datatype_qcint8, convolution.weight_scale.data(), 4, 0, dims,
        copies().copy(convolution.weights), XNN_INVALID_VALUE_ID, 0, &id);
  }
  xnn_status define_bias(size_t layer, const size_t (&dims)[1], uint32_t& id) override {
    const FixedPointConvolution& convolution = fixed_.convolutions[layer];
    std::vector<float>& scale =
        bias_scales_.emplace_back(convolution.weight_scale.begin(), convolution.weight_scale.end());
    for (float& each : scale) each *= fixed_.values[network().layers[layer].inputs[0]].scale;
    return xnn_define_channelwise_quantized_tensor_value(
        subgraph(), xnn_datatype_qcint32, scale.data(), 1, 0, dims, copies().copy(convolution.bias),
        XNN_INVALID_VALUE_ID, 0, &id);
  }

  const FixedPointNetwork& fixed_;
  std::deque<std::vector<float>> bias_scales_;  // until the runtime is made
};

// Everything that the result needs but the two ends.
GraphPlan plan_middle(const Network& network) {
  GraphPlan plan{.made = find_needed(network), .output = network.layers.back().inputs[0]};
  plan.made[0] = plan.made.back() = false;
  for (uint32_t i = 0; i < network.layers.size(); ++i) {
    if (!plan.made[i + 1] || !is_first(network.layers[i])) continue;
    plan.made[i + 1] = false;
    plan.inputs.push_back(i + 1);
  }
  return plan;
}

// 1 for every texel that a kernel around it can reach a drawn one from.
void mark_active(std::span<const uint32_t> drawn, uint32_t size, uint32_t kernel,
                 Buffer<uint8_t>& active) {
  const int32_t reach = static_cast<int32_t>(kernel / 2), side = static_cast<int32_t>(size);
  for (const uint32_t texel : drawn) {
    const int32_t v = static_cast<int32_t>(texel / size), u = static_cast<int32_t>(texel % size);
    for (int32_t y = std::max(v - reach, 0); y <= std::min(v + reach, side - 1); ++y) {
      for (int32_t x = std::max(u - reach, 0); x <= std::min(u + reach, side - 1); ++x)
        active[size_t(y * side + x)] = 1;
    }
  }
}

// Free functions with restricted pointers, or the compiler would have to expect that a byte written
// changes what is read next.
void requantise_all(const int32_t* __restrict sums, const float* __restrict multiplier,
                    int32_t zero_point, int32_t lowest, uint32_t count, int8_t* __restrict to) {
  for (uint32_t o = 0; o < count; ++o)
    to[o] = requantise(sums[o], multiplier[o], zero_point, lowest);
}

[[gnu::noinline]] void quantise_all(const float* __restrict from, float scale, size_t count,
                                    int16_t* __restrict to) {
  for (size_t i = 0; i < count; ++i) to[i] = quantise_input(from[i], scale);
}

}  // namespace

Result<std::unique_ptr<FixedPointRunner>> FixedPointRunner::create(const Network& network,
                                                                   const FixedPointNetwork& fixed,
                                                                   const FixedPointUse& use,
                                                                   ThreadPool& pool,
                                                                   const KernelTable& kernels) {
  FIG_RETURN_IF_ERROR(validate_fixed_point(network, fixed));
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  std::unique_ptr<FixedPointRunner> runner(new (std::nothrow) FixedPointRunner(pool, kernels));
  if (runner == nullptr) return out_of_memory("a network");
  FIG_RETURN_IF_ERROR(runner->prepare(network, fixed, use, shapes));
  return runner;
}

Status FixedPointRunner::prepare(const Network& network, const FixedPointNetwork& fixed,
                                 const FixedPointUse& use, const std::vector<ValueShape>& shapes) {
  const uint32_t channels = shapes.front().channels;
  size_ = shapes.front().size;
  const size_t texels = size_t{size_} * size_;
  FIG_CHECK(use.varying_channels <= channels &&
                use.constants.size() == texels * (channels - use.varying_channels),
            "the input's channels");
  input_scale_ = fixed.values[0].scale;
  macs_ = count_macs(network, shapes);
  if (!constants_.ensure(use.constants.size())) return out_of_memory("a network's constants");
  quantise_all(use.constants.data(), input_scale_, use.constants.size(), constants_.data());
  if (!map_.ensure(size_, use.varying_channels)) return out_of_memory("a network's input");
  input_count_ = texels * map_.stride();
  if (!input_.ensure(input_count_)) return out_of_memory("a network's input");

  const GraphPlan plan = plan_middle(network);
  for (const uint32_t value : plan.inputs)
    FIG_RETURN_IF_ERROR(prepare_first(network, fixed, use, value - 1));
  FIG_RETURN_IF_ERROR(prepare_middle(network, fixed, shapes));
  FIG_RETURN_IF_ERROR(prepare_head(network, fixed, use, shapes[network.layers.back().inputs[0]]));
  FIG_RETURN_IF_ERROR(prepare_scratch());
  // Of an input of zeros: where nothing is ever drawn, that is the result of every frame.
  for (FirstConvolution& first : first_) {
    for (uint32_t y = 0; y < size_; ++y) run_first(first, Texels::kOthers, y);
  }
  constants_ = {};
  return {};
}

Status FixedPointRunner::prepare_first(const Network& network, const FixedPointNetwork& fixed,
                                       const FixedPointUse& use, size_t i) {
  const Layer& layer = network.layers[i];
  const FixedPointConvolution& convolution = fixed.convolutions[i];
  const Quantisation& quantisation = fixed.values[i + 1];
  FirstConvolution& first = first_.emplace_back();
  const ValueShape input{size_, network.input_channels};
  const size_t texels = size_t{size_} * size_;
  if (!first.sums.prepare(kernels_, layer, convolution, input, use.varying_channels,
                          constants_.span(use.constants.size())) ||
      !first.multiplier.ensure(layer.out_channels) || !first.active.ensure(texels) ||
      !first.output.ensure(texels * layer.out_channels)) {
    return out_of_memory("a network's first convolution");
  }
  first.value = static_cast<uint32_t>(i + 1);
  first.zero_point = quantisation.zero_point;
  first.lowest = layer.relu ? quantisation.zero_point : kInt8Min;
  for (uint32_t o = 0; o < layer.out_channels; ++o) {
    first.multiplier[o] =
        requantisation_multiplier(input_scale_, convolution.weight_scale[o], quantisation.scale);
  }
  mark_active(use.drawn, size_, layer.kernel, first.active);
  return {};
}

Status FixedPointRunner::prepare_middle(const Network& network, const FixedPointNetwork& fixed,
                                        const std::vector<ValueShape>& shapes) {
  GraphPlan plan = plan_middle(network);
  const auto of_value = [&](uint32_t value) {
    return std::find_if(first_.begin(), first_.end(),
                        [&](const FirstConvolution& first) { return first.value == value; });
  };
  if (plan.output == 0) return {};
  if (const auto first = of_value(plan.output); first != first_.end()) {
    head_input_ = first->output.data();
    return {};
  }
  FIG_RETURN_IF_ERROR(initialize_xnnpack());
  if (!middle_.ensure(element_count(shapes[plan.output])))
    return out_of_memory("a network's output");
  std::vector<void*> buffers;
  for (const uint32_t value : plan.inputs) buffers.push_back(of_value(value)->output.data());
  buffers.push_back(middle_.data());
  xnnpack_bytes_ = estimate_xnnpack_bytes(network, shapes, plan, sizeof(int8_t));
  head_input_ = middle_.data();
  return FixedPointGraphBuilder(network, shapes, plan, fixed)
      .build(buffers, xnnpack_bytes_, pool_, runtime_)
      .within("network");
}

Status FixedPointRunner::prepare_head(const Network& network, const FixedPointNetwork& fixed,
                                      const FixedPointUse& use, const ValueShape& input) {
  const Layer& layer = network.layers.back();
  const FixedPointConvolution& convolution = fixed.convolutions.back();
  const Quantisation& quantisation = fixed.values[layer.inputs[0]];
  const bool reads_input = layer.inputs[0] == 0;
  if (!head_.prepare(kernels_, layer, convolution, input,
                     reads_input ? use.varying_channels : input.channels,
                     reads_input ? constants_.span(use.constants.size()) : std::span<int16_t>()) ||
      !head_scale_.ensure(layer.out_channels) ||
      !output_.ensure(use.wanted.size() * layer.out_channels)) {
    return out_of_memory("a network's last convolution");
  }
  head_zero_point_ = quantisation.zero_point;
  head_size_ = input.size;
  for (uint32_t o = 0; o < layer.out_channels; ++o)
    head_scale_[o] = quantisation.scale * convolution.weight_scale[o];
  wanted_ = use.wanted;
  for (const uint32_t texel : wanted_)
    FIG_CHECK(texel < size_t{head_size_} * head_size_, "a wanted texel of the result");
  return {};
}

Status FixedPointRunner::prepare_scratch() {
  patch_stride_ = head_.patch_length();
  sums_stride_ = head_.sums_length();
  for (const FirstConvolution& first : first_) {
    patch_stride_ = std::max(patch_stride_, first.sums.patch_length());
    sums_stride_ = std::max(sums_stride_, first.sums.sums_length());
  }
  // Tasks next to each other do not share a cache line.
  patch_stride_ = (patch_stride_ + 31) / 32 * 32;
  sums_stride_ = (sums_stride_ + 15) / 16 * 16;
  const size_t groups = (wanted_.size() + kWantedGroup - 1) / kWantedGroup;
  if (!all_groups_.ensure(groups)) return out_of_memory("a network's texels");
  for (size_t group = 0; group < groups; ++group) all_groups_[group] = static_cast<uint32_t>(group);
  const size_t tasks = std::max<size_t>(size_, (groups + kGroupsPerTask - 1) / kGroupsPerTask);
  if (!patches_.ensure(tasks * patch_stride_) || !sums_.ensure(tasks * sums_stride_))
    return out_of_memory("a network's sums");
  return {};
}

void FixedPointRunner::quantise_row(uint32_t y) {
  const size_t count = size_t{size_} * map_.stride();
  quantise_all(input_.data() + y * count, input_scale_, count, map_.row(static_cast<int32_t>(y)));
}

void FixedPointRunner::run_first(FirstConvolution& first, Texels texels, uint32_t y) {
  int16_t* patch = patches_.data() + y * patch_stride_;
  int32_t* sums = sums_.data() + y * sums_stride_;
  const uint32_t outputs = first.sums.outputs();
  for (uint32_t x = 0; x < size_; ++x) {
    const size_t texel = size_t{y} * size_ + x;
    if (first.active[texel] != static_cast<uint8_t>(texels)) continue;
    first.sums.gather(map_, x, y, patch);
    first.sums.sum(kernels_, patch, x, y, sums);
    requantise_all(sums, first.multiplier.data(), first.zero_point, first.lowest, outputs,
                   first.output.data() + texel * outputs);
  }
}

void FixedPointRunner::run_head(std::span<const uint32_t> groups, size_t task) {
  int16_t* patch = patches_.data() + task * patch_stride_;
  int32_t* sums = sums_.data() + task * sums_stride_;
  const uint32_t outputs = head_.outputs();
  const auto run_texel = [&](size_t i) {
    const uint32_t x = wanted_[i] % head_size_, y = wanted_[i] / head_size_;
    if (head_input_ == nullptr) {
      head_.gather(map_, x, y, patch);
    } else {
      head_.gather(head_input_, head_zero_point_, x, y, patch);
    }
    head_.sum(kernels_, patch, x, y, sums);
    float* to = output_.data() + i * outputs;
    for (uint32_t o = 0; o < outputs; ++o) to[o] = static_cast<float>(sums[o]) * head_scale_[o];
  };
  const size_t begin = task * kGroupsPerTask;
  for (const uint32_t group :
       groups.subspan(begin, std::min(kGroupsPerTask, groups.size() - begin))) {
    const size_t first = size_t{group} * kWantedGroup;
    for (size_t i = first; i < std::min(first + kWantedGroup, wanted_.size()); ++i) run_texel(i);
  }
}

Status FixedPointRunner::run() {
  return run(all_groups_.span((wanted_.size() + kWantedGroup - 1) / kWantedGroup));
}

Status FixedPointRunner::run(std::span<const uint32_t> groups) {
  pool_.for_each(size_, [&](size_t y) { quantise_row(static_cast<uint32_t>(y)); });
  for (FirstConvolution& first : first_) {
    pool_.for_each(size_,
                   [&](size_t y) { run_first(first, Texels::kActive, static_cast<uint32_t>(y)); });
  }
  if (runtime_ != nullptr)
    FIG_RETURN_IF_ERROR(xnnpack_status(xnn_invoke_runtime(runtime_.get()), "running the network"));
  run_further(groups);
  return {};
}

void FixedPointRunner::run_further(std::span<const uint32_t> groups) {
  pool_.for_each((groups.size() + kGroupsPerTask - 1) / kGroupsPerTask,
                 [&](size_t task) { run_head(groups, task); });
}

uint64_t FixedPointRunner::memory_bytes() const {
  uint64_t bytes = input_.memory_bytes() + map_.memory_bytes() + middle_.memory_bytes() +
                   head_.memory_bytes() + head_scale_.memory_bytes() + output_.memory_bytes() +
                   patches_.memory_bytes() + sums_.memory_bytes() + all_groups_.memory_bytes() +
                   xnnpack_bytes_;
  for (const FirstConvolution& first : first_) {
    bytes += first.sums.memory_bytes() + first.multiplier.memory_bytes() +
             first.active.memory_bytes() + first.output.memory_bytes();
  }
  return bytes;
}

}  // namespace figurine
