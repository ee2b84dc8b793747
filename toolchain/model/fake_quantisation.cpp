#include "toolchain/model/fake_quantisation.h"

#include "toolchain/model/unet_plan.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

// Per-channel factors against [1,C,H,W] values and [out,in,k,k] kernels.
torch::Tensor over_pixels(const torch::Tensor& channels) { return channels.view({1, -1, 1, 1}); }
torch::Tensor over_kernels(const torch::Tensor& outputs) { return outputs.view({-1, 1, 1, 1}); }

// One convolution's weights in integer units.
struct IntegerWeights {
  torch::Tensor kernel;    // [out,in,k,k]
  torch::Tensor bias;      // [out]
  torch::Tensor sum_unit;  // [out] what one unit of a sum is worth: input scale x weight scale
  torch::Tensor inside;    // where the kernel was not clipped; undefined if it was not rounded
};

IntegerWeights integer_weights(const torch::Tensor& flat, const UNetPlan& plan,
                               const FakeQuantisation& quantisation, size_t layer) {
  const ConvolutionSlot& slot = plan.slots[layer];
  const torch::Tensor& scale = quantisation.weight_scale[layer];
  IntegerWeights weights;
  weights.sum_unit = scale * quantisation.values[plan.network.layers[layer].inputs[0]].scale;
  weights.kernel = UNetPlan::kernel_of(flat, slot) / over_kernels(scale);
  weights.bias = UNetPlan::bias_of(flat, slot) / weights.sum_unit;
  if (quantisation.round_weights[layer]) {
    weights.inside = weights.kernel.abs().le_(kWeightMax);
    weights.kernel.clamp_(-kWeightMax, kWeightMax).round_();
    if (quantisation.round_biases) weights.bias.round_();
  }
  return weights;
}

// The value at its own range's resolution, in its old units. Zero is always in the range.
torch::Tensor round_to_own_range(const torch::Tensor& value) {
  const float low = std::min(0.0f, value.min().item<float>()),
              high = std::max(0.0f, value.max().item<float>());
  const float scale = high > low ? (high - low) / float(kInt8Max - kInt8Min) : 1.0f;
  const float zero_point = std::nearbyint(float(kInt8Min) - low / scale);
  return (value / scale)
      .round_()
      .clamp_(float(kInt8Min) - zero_point, float(kInt8Max) - zero_point)
      .mul_(scale);
}

// A convolution's sums to its output: ReLU, rounding and clipping. `passed`: where the gradient
// goes through; undefined for everywhere.
torch::Tensor requantise_sums(torch::Tensor sums, const UNetPlan& plan,
                              const FakeQuantisation& quantisation, size_t layer,
                              torch::Tensor& passed) {
  const Quantisation& to = quantisation.values[layer + 1];
  const float lowest = float(kInt8Min - to.zero_point), highest = float(kInt8Max - to.zero_point);
  const bool relu = plan.network.layers[layer].relu;
  if (quantisation.dynamic_ranges || !quantisation.round_value[layer + 1]) {
    if (!relu) return sums;
    passed = sums.gt(0);
    return sums.relu_();
  }
  const float low = relu ? 0.0f : lowest;
  passed = sums.gt(low).logical_and_(sums.lt(highest));
  return sums.clamp_(low, highest).round_();
}

struct Evaluation {
  std::vector<torch::Tensor> values;   // [layers + 1]
  std::vector<torch::Tensor> pooled;   // [layers] indices of max pools
  std::vector<torch::Tensor> passed;   // [layers] see requantise_sums
  std::vector<torch::Tensor> kernels;  // [layers]
};

torch::Tensor evaluate_convolution(const torch::Tensor& flat, const UNetPlan& plan,
                                   const FakeQuantisation& quantisation, size_t layer,
                                   Evaluation& evaluation) {
  const ConvolutionSlot& slot = plan.slots[layer];
  torch::Tensor a = evaluation.values[plan.network.layers[layer].inputs[0]];
  if (quantisation.dynamic_ranges) a = round_to_own_range(a);
  const IntegerWeights weights = integer_weights(flat, plan, quantisation, layer);
  evaluation.kernels[layer] = weights.kernel;
  torch::Tensor sums = unbatched(at::convolution(batched(a, slot), weights.kernel, weights.bias,
                                                 {1, 1}, slot.padding(), {1, 1}, false, {0, 0}, 1),
                                 a);
  if (plan.is_head(layer)) return sums.mul_(over_pixels(weights.sum_unit));
  sums.mul_(over_pixels(weights.sum_unit / quantisation.values[layer + 1].scale));
  return requantise_sums(std::move(sums), plan, quantisation, layer, evaluation.passed[layer]);
}

torch::Tensor quantise_network_input(const torch::Tensor& input,
                                     const FakeQuantisation& quantisation) {
  torch::Tensor steps = as_channels_last(input) / quantisation.values[0].scale;
  if (quantisation.dynamic_ranges || !quantisation.round_value[0]) return steps;
  return steps.clamp_(-quantisation.input_max, quantisation.input_max).round_();
}

Evaluation evaluate_layers(const torch::Tensor& flat, const torch::Tensor& input,
                           const UNetPlan& plan, const FakeQuantisation& quantisation) {
  const std::vector<Layer>& layers = plan.network.layers;
  const size_t count = layers.size();
  Evaluation evaluation{std::vector<torch::Tensor>(count + 1), std::vector<torch::Tensor>(count),
                        std::vector<torch::Tensor>(count), std::vector<torch::Tensor>(count)};
  std::vector<torch::Tensor>& values = evaluation.values;
  values[0] = quantise_network_input(input, quantisation);
  for (size_t i = 0; i < count; ++i) {
    const torch::Tensor& a = values[layers[i].inputs[0]];
    switch (layers[i].op) {
      case LayerOp::kConv2d:
        values[i + 1] = evaluate_convolution(flat, plan, quantisation, i, evaluation);
        break;
      case LayerOp::kMaxPool2:
        std::tie(values[i + 1], evaluation.pooled[i]) =
            at::max_pool2d_with_indices(a, {2, 2}, {2, 2});
        break;
      case LayerOp::kUpsample2:
        // Sixteenths of integers are exact in float; (sum + 8) >> 4 is floor(x + 1/2), whatever the
        // zero point.
        values[i + 1] = at::upsample_bilinear2d(a, {2 * a.size(2), 2 * a.size(3)}, false);
        if (!quantisation.dynamic_ranges && quantisation.round_value[i + 1])
          values[i + 1].add_(0.5f).floor_();
        break;
      case LayerOp::kConcat:
        values[i + 1] = at::cat({a, values[layers[i].inputs[1]]}, 1);
        break;
    }
  }
  return evaluation;
}

// The graph's node holds the settings by a capsule.
struct SharedQuantisation : torch::CustomClassHolder {
  std::shared_ptr<const FakeQuantisation> settings;
};

class RunFakeQuantised : public torch::autograd::Function<RunFakeQuantised> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& flat,
                               const torch::Tensor& input, const c10::intrusive_ptr<UNetPlan>& plan,
                               const c10::intrusive_ptr<SharedQuantisation>& quantisation) {
    Evaluation evaluation = evaluate_layers(flat, input, *plan, *quantisation->settings);
    torch::Tensor head = as_rows(evaluation.values.back());
    evaluation.values.back() = torch::Tensor();  // the backward pass does not need it
    context->saved_data["plan"] = c10::IValue::make_capsule(plan);
    context->saved_data["quantisation"] = c10::IValue::make_capsule(quantisation);
    context->saved_data["flat"] = flat;
    context->saved_data["values"] = std::move(evaluation.values);
    context->saved_data["pooled"] = std::move(evaluation.pooled);
    context->saved_data["passed"] = std::move(evaluation.passed);
    context->saved_data["kernels"] = std::move(evaluation.kernels);
    return head;
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list output_gradients) {
    const auto list = [&](const char* name) { return context->saved_data[name].toTensorVector(); };
    const auto plan =
        c10::static_intrusive_pointer_cast<UNetPlan>(context->saved_data["plan"].toCapsule());
    const auto shared = c10::static_intrusive_pointer_cast<SharedQuantisation>(
        context->saved_data["quantisation"].toCapsule());
    const FakeQuantisation& quantisation = *shared->settings;
    TORCH_CHECK(!quantisation.dynamic_ranges, "no gradient through dynamic quantisation");
    const torch::Tensor flat = context->saved_data["flat"].toTensor();
    const std::vector<torch::Tensor> values = list("values"), pooled = list("pooled"),
                                     passed = list("passed"), kernels = list("kernels");
    const std::vector<Layer>& layers = plan->network.layers;
    torch::Tensor flat_gradient = torch::zeros({plan->parameters});
    ValueGradients gradients(layers.size() + 1);
    gradients.give(static_cast<uint32_t>(layers.size()),
                   as_channels_last(output_gradients[0].contiguous()));
    for (size_t i = layers.size(); i-- > 0;) {
      const Layer& layer = layers[i];
      torch::Tensor gradient = gradients.take(i + 1);
      const torch::Tensor& a = values[layer.inputs[0]];
      if (!gradient.defined()) continue;  // nothing reads this value
      if (layer.op != LayerOp::kConv2d) {
        give_back(layer, gradient, a, pooled[i], gradients);
        continue;
      }
      const ConvolutionSlot& slot = plan->slots[i];
      const IntegerWeights weights = integer_weights(flat, *plan, quantisation, i);
      const float output_unit = plan->is_head(i) ? 1.0f : quantisation.values[i + 1].scale;
      if (passed[i].defined()) gradient = gradient * passed[i];
      gradient = gradient * over_pixels(weights.sum_unit / output_unit);
      const bool to_input = layer.inputs[0] != 0;
      auto [d_input, d_kernel, d_bias] = at::convolution_backward(
          batched(gradient, slot), batched(a, slot), kernels[i], at::IntArrayRef(slot.out), {1, 1},
          slot.padding(), {1, 1}, false, {0, 0}, 1, {to_input, true, true});
      d_kernel = d_kernel / over_kernels(quantisation.weight_scale[i]);
      if (weights.inside.defined()) d_kernel.mul_(weights.inside);
      UNetPlan::kernel_of(flat_gradient, slot).copy_(d_kernel);
      UNetPlan::bias_of(flat_gradient, slot).copy_(d_bias / weights.sum_unit);
      if (to_input) gradients.give(layer.inputs[0], unbatched(d_input, a));
    }
    return {flat_gradient, {}, {}, {}};
  }
};

}  // namespace

void check_fake_quantisation(const FakeQuantisation& quantisation, const UNetPlan& plan) {
  const size_t layers = plan.network.layers.size();
  TORCH_CHECK(quantisation.values.size() == layers && quantisation.weight_scale.size() == layers &&
                  quantisation.round_weights.size() == layers &&
                  quantisation.round_value.size() == layers,
              "fake quantisation: not one entry per layer");
  for (size_t i = 0; i < layers; ++i) {
    if (plan.network.layers[i].op != LayerOp::kConv2d) continue;
    const torch::Tensor& scale = quantisation.weight_scale[i];
    TORCH_CHECK(scale.defined() && scale.dim() == 1 && scale.size(0) == plan.slots[i].out,
                "fake quantisation: layer ", i, ": not one scale per output");
  }
}

torch::Tensor run_fake_quantised(const torch::Tensor& flat, const torch::Tensor& input,
                                 const c10::intrusive_ptr<UNetPlan>& plan,
                                 const std::shared_ptr<const FakeQuantisation>& quantisation) {
  auto shared = c10::make_intrusive<SharedQuantisation>();
  shared->settings = quantisation;
  return RunFakeQuantised::apply(flat, input, plan, shared);
}

std::vector<torch::Tensor> fake_quantised_values(const torch::Tensor& flat,
                                                 const torch::Tensor& input, const UNetPlan& plan,
                                                 const FakeQuantisation& quantisation) {
  return evaluate_layers(flat, input, plan, quantisation).values;
}

}  // namespace figurine::model
