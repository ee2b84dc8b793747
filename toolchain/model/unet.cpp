#include "toolchain/model/unet.h"

#include <cmath>
#include <string>

#include "toolchain/error.h"
#include "toolchain/model/fake_quantisation.h"
#include "toolchain/model/unet_plan.h"
#include "toolchain/random/split_mix.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model {

namespace {

constexpr at::MemoryFormat kChannelsLast = at::MemoryFormat::ChannelsLast;

}  // namespace

torch::Tensor batched(const torch::Tensor& t, const ConvolutionSlot& slot) {
  constexpr int64_t kBatch = 16;
  const int64_t channels = t.size(1), height = t.size(2), width = t.size(3);
  if (slot.kernel != 1 || height % kBatch != 0) return t;
  return t.permute({0, 2, 3, 1})
      .reshape({kBatch, height / kBatch, width, channels})
      .permute({0, 3, 1, 2});
}

torch::Tensor unbatched(const torch::Tensor& t, const torch::Tensor& like) {
  if (t.size(0) == 1) return t;
  return t.permute({0, 2, 3, 1})
      .reshape({1, like.size(2), like.size(3), t.size(1)})
      .permute({0, 3, 1, 2});
}

void give_back(const Layer& layer, const torch::Tensor& gradient, const torch::Tensor& a,
               const torch::Tensor& pooled, ValueGradients& gradients) {
  switch (layer.op) {
    case LayerOp::kConv2d:
      break;  // the caller's
    case LayerOp::kMaxPool2:
      gradients.give(layer.inputs[0],
                     at::max_pool2d_with_indices_backward(gradient, a, {2, 2}, {2, 2}, {0, 0},
                                                          {1, 1}, false, pooled));
      break;
    case LayerOp::kUpsample2:
      gradients.give(layer.inputs[0],
                     at::upsample_bilinear2d_backward(gradient, {2 * a.size(2), 2 * a.size(3)},
                                                      a.sizes(), false));
      break;
    case LayerOp::kConcat: {
      const int64_t first = a.size(1);
      gradients.give(layer.inputs[0], gradient.narrow(1, 0, first).contiguous(kChannelsLast));
      gradients.give(layer.inputs[1],
                     gradient.narrow(1, first, gradient.size(1) - first).contiguous(kChannelsLast));
      break;
    }
  }
}

namespace {

// Every value of one evaluation [layers + 1], and what the layers' backward passes need beside:
// cast kernels, indices of pools.
struct Evaluation {
  std::vector<torch::Tensor> values, extra;
};

Evaluation evaluate_layers(const torch::Tensor& flat, const torch::Tensor& input,
                           const UNetPlan& plan) {
  const std::vector<Layer>& layers = plan.network.layers;
  Evaluation evaluation{std::vector<torch::Tensor>(layers.size() + 1),
                        std::vector<torch::Tensor>(layers.size())};
  auto& [values, extra] = evaluation;
  values[0] = as_channels_last(input).to(plan.type_of(0));
  for (size_t i = 0; i < layers.size(); ++i) {
    const torch::Tensor& a = values[layers[i].inputs[0]];
    torch::Tensor& out = values[i + 1];
    switch (layers[i].op) {
      case LayerOp::kConv2d: {
        const torch::ScalarType type = plan.type_of(i);
        const ConvolutionSlot& slot = plan.slots[i];
        extra[i] = UNetPlan::kernel_of(flat, slot).to(type);
        out = unbatched(at::convolution(batched(a.to(type), slot), extra[i],
                                        UNetPlan::bias_of(flat, slot).to(type), {1, 1},
                                        slot.padding(), {1, 1}, false, {0, 0}, 1),
                        a);
        if (layers[i].relu) out.relu_();
        break;
      }
      case LayerOp::kMaxPool2:
        std::tie(out, extra[i]) = at::max_pool2d_with_indices(a, {2, 2}, {2, 2});
        break;
      case LayerOp::kUpsample2:
        out = at::upsample_bilinear2d(a, {2 * a.size(2), 2 * a.size(3)}, false);
        break;
      case LayerOp::kConcat:
        out = at::cat({a, values[layers[i].inputs[1]]}, 1);
        break;
    }
  }
  return evaluation;
}

// The whole network as one node of the graph: forward keeps every value, backward walks the layers
// in reverse. Saves the per-operation cost of autograd and of autocast's casts, and writes all
// weight gradients into one flat tensor.
class RunUNet : public torch::autograd::Function<RunUNet> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& flat,
                               const torch::Tensor& input,
                               const c10::intrusive_ptr<UNetPlan>& plan) {
    auto [values, extra] = evaluate_layers(flat, input, *plan);
    torch::Tensor head = as_rows(values.back());
    values.back() = torch::Tensor();  // the backward pass does not need it
    context->saved_data["plan"] = c10::IValue::make_capsule(plan);
    context->saved_data["values"] = std::move(values);
    context->saved_data["extra"] = std::move(extra);
    return head;
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list output_gradients) {
    const auto plan =
        c10::static_intrusive_pointer_cast<UNetPlan>(context->saved_data["plan"].toCapsule());
    const std::vector<torch::Tensor> values = context->saved_data["values"].toTensorVector(),
                                     extra = context->saved_data["extra"].toTensorVector();
    const std::vector<Layer>& layers = plan->network.layers;
    torch::Tensor flat = torch::empty({plan->parameters});
    ValueGradients gradients(layers.size() + 1);
    gradients.give(static_cast<uint32_t>(layers.size()),
                   as_channels_last(output_gradients[0].contiguous()));
    for (size_t i = layers.size(); i-- > 0;) {
      const Layer& layer = layers[i];
      torch::Tensor gradient = gradients.take(i + 1);
      const torch::Tensor& a = values[layer.inputs[0]];
      if (!gradient.defined()) {  // nothing reads this value
        if (layer.op == LayerOp::kConv2d)
          flat.narrow(0, plan->slots[i].weights, plan->slots[i].end() - plan->slots[i].weights)
              .zero_();
        continue;
      }
      if (layer.op != LayerOp::kConv2d) {
        give_back(layer, gradient, a, extra[i], gradients);
        continue;
      }
      const torch::ScalarType type = plan->type_of(i);
      const ConvolutionSlot& slot = plan->slots[i];
      if (layer.relu) gradient = at::threshold_backward(gradient, values[i + 1], 0);
      const bool to_input = layer.inputs[0] != 0;
      auto [d_input, d_kernel, d_bias] =
          at::convolution_backward(batched(gradient.to(type), slot), batched(a.to(type), slot),
                                   extra[i], at::IntArrayRef(slot.out), {1, 1}, slot.padding(),
                                   {1, 1}, false, {0, 0}, 1, {to_input, true, true});
      UNetPlan::kernel_of(flat, slot).copy_(d_kernel);
      UNetPlan::bias_of(flat, slot).copy_(d_bias);
      if (to_input) gradients.give(layer.inputs[0], unbatched(d_input, a).to(a.scalar_type()));
    }
    return {flat, {}, {}};
  }
};

}  // namespace

struct PoseUNet::Impl {
  c10::intrusive_ptr<UNetPlan> plan = c10::make_intrusive<UNetPlan>();
  torch::Tensor weights;
  std::shared_ptr<const FakeQuantisation> fake_quantisation;  // null: plain
};

PoseUNet::PoseUNet(const Network& network, const PoseUNetOptions& options)
    : impl_(std::make_unique<Impl>()) {
  UNetPlan& plan = *impl_->plan;
  plan.network = network;
  plan.precision = options.precision;
  plan.shapes = value_or_throw(infer_shapes(network, false), "pose UNet");
  if (network.layers.back().op != LayerOp::kConv2d)
    throw InputError("pose UNet: network: the last layer is not a convolution");
  plan.slots.resize(network.layers.size());
  for (size_t i = 0; i < network.layers.size(); ++i) {
    Layer& layer = plan.network.layers[i];
    layer.weights = layer.bias = {};
    if (layer.op != LayerOp::kConv2d) continue;
    ConvolutionSlot& slot = plan.slots[i];
    slot.in = plan.shapes[layer.inputs[0]].channels;
    slot.out = layer.out_channels;
    slot.kernel = layer.kernel;
    slot.weights = plan.parameters;
    slot.bias = slot.weights + slot.out * slot.kernel * slot.kernel * slot.in;
    plan.parameters = slot.end();
  }
  // He et al., Delving Deep into Rectifiers, 2015, eq. 10, with a uniform distribution of the same
  // variance: no libm but sqrt, which is exact everywhere.
  impl_->weights = torch::zeros({plan.parameters});
  float* const flat = impl_->weights.mutable_data_ptr<float>();
  random::SplitMix random(options.seed);
  for (size_t i = 0; i < network.layers.size(); ++i) {
    if (network.layers[i].op != LayerOp::kConv2d) continue;
    const ConvolutionSlot& slot = plan.slots[i];
    float bound = std::sqrt(6.0f / static_cast<float>(slot.kernel * slot.kernel * slot.in));
    if (plan.is_head(i)) bound *= options.head_weight_factor;
    for (int64_t k = slot.weights; k < slot.bias; ++k) flat[k] = bound * random.signed_unit();
    if (plan.is_head(i) && slot.out >= 14) {
      for (int64_t channel = 11; channel < 14; ++channel)
        flat[slot.bias + channel] = options.rgb_bias;
    }
  }
  impl_->weights.requires_grad_();
}

PoseUNet::~PoseUNet() = default;

void PoseUNet::check_input(const torch::Tensor& input) const {
  const UNetPlan& plan = *impl_->plan;
  const int64_t size = plan.network.input_size, channels = plan.network.input_channels;
  TORCH_CHECK(input.scalar_type() == torch::kFloat && input.is_contiguous() &&
                  input.sizes() == torch::IntArrayRef({size, size, channels}),
              "PoseUNet: the input must be contiguous floats [", size, ",", size, ",", channels,
              "]");
}

torch::Tensor PoseUNet::forward(const torch::Tensor& input) {
  check_input(input);
  if (impl_->fake_quantisation != nullptr)
    return run_fake_quantised(impl_->weights, input, impl_->plan, impl_->fake_quantisation);
  return RunUNet::apply(impl_->weights, input, impl_->plan);
}

std::vector<torch::Tensor> PoseUNet::evaluate_values(const torch::Tensor& input) const {
  check_input(input);
  torch::NoGradGuard no_gradient;
  if (impl_->fake_quantisation != nullptr)
    return fake_quantised_values(impl_->weights, input, *impl_->plan, *impl_->fake_quantisation);
  return evaluate_layers(impl_->weights, input, *impl_->plan).values;
}

void PoseUNet::set_fake_quantisation(std::shared_ptr<const FakeQuantisation> quantisation) {
  if (quantisation != nullptr) {
    TORCH_CHECK(impl_->plan->precision == Precision::kFloat32,
                "fake quantisation needs float: bf16 holds no multiple of a scale");
    check_fake_quantisation(*quantisation, *impl_->plan);
  }
  impl_->fake_quantisation = std::move(quantisation);
}

torch::Tensor& PoseUNet::weights() { return impl_->weights; }
const torch::Tensor& PoseUNet::weights() const { return impl_->weights; }
torch::Tensor& PoseUNet::gradients() { return impl_->weights.mutable_grad(); }
void PoseUNet::zero_gradients() { impl_->weights.mutable_grad() = torch::Tensor(); }

void PoseUNet::share_weights(const PoseUNet& other) {
  TORCH_CHECK(impl_->weights.numel() == other.impl_->weights.numel(),
              "PoseUNet: weights of another shape");
  impl_->weights = other.impl_->weights.detach().requires_grad_();
}

uint64_t PoseUNet::parameter_count() const {
  return static_cast<uint64_t>(impl_->plan->parameters);
}

std::vector<uint64_t> PoseUNet::token_lengths() const {
  std::vector<uint64_t> lengths;
  for (size_t i = 0; i < impl_->plan->slots.size(); ++i) {
    const ConvolutionSlot& slot = impl_->plan->slots[i];
    if (impl_->plan->network.layers[i].op == LayerOp::kConv2d)
      lengths.push_back(static_cast<uint64_t>(slot.end() - slot.weights));
  }
  return lengths;
}

std::vector<ParameterGroup> PoseUNet::muon_groups() const {
  const UNetPlan& plan = *impl_->plan;
  std::vector<ParameterGroup> groups;
  for (size_t i = 0; i < plan.slots.size(); ++i) {
    const ConvolutionSlot& slot = plan.slots[i];
    if (plan.network.layers[i].op != LayerOp::kConv2d) continue;
    groups.push_back({slot.weights, slot.bias, plan.is_head(i) ? 0 : slot.out});
    groups.push_back({slot.bias, slot.end(), 0});
  }
  return groups;
}

std::vector<KernelMatrix> PoseUNet::kernels() const {
  std::vector<KernelMatrix> kernels;
  for (size_t i = 0; i < impl_->plan->slots.size(); ++i) {
    const ConvolutionSlot& slot = impl_->plan->slots[i];
    if (impl_->plan->network.layers[i].op == LayerOp::kConv2d)
      kernels.push_back({slot.weights, slot.out, slot.kernel * slot.kernel * slot.in});
  }
  return kernels;
}

Network PoseUNet::export_network(std::vector<float>& storage) const {
  const float* flat = impl_->weights.const_data_ptr<float>();
  storage.assign(flat, flat + impl_->plan->parameters);
  Network network = impl_->plan->network;
  for (size_t i = 0; i < network.layers.size(); ++i) {
    if (network.layers[i].op != LayerOp::kConv2d) continue;
    const ConvolutionSlot& slot = impl_->plan->slots[i];
    network.layers[i].weights = {storage.data() + slot.weights,
                                 static_cast<size_t>(slot.bias - slot.weights)};
    network.layers[i].bias = {storage.data() + slot.bias, static_cast<size_t>(slot.out)};
  }
  return network;
}

void PoseUNet::import_network(const Network& network) {
  const UNetPlan& plan = *impl_->plan;
  value_or_throw(infer_shapes(network, true), "pose UNet");
  const auto differs = [](const std::string& what) {
    throw InputError("pose UNet: network: " + what + " differs from this UNet's");
  };
  if (network.input_size != plan.network.input_size ||
      network.input_channels != plan.network.input_channels)
    differs("the input's shape");
  if (network.layers.size() != plan.network.layers.size()) differs("the number of layers");
  for (size_t i = 0; i < network.layers.size(); ++i) {
    const Layer &theirs = network.layers[i], &ours = plan.network.layers[i];
    if (theirs.op != ours.op || theirs.inputs[0] != ours.inputs[0] ||
        theirs.inputs[1] != ours.inputs[1] || theirs.out_channels != ours.out_channels ||
        theirs.kernel != ours.kernel || theirs.relu != ours.relu) {
      differs("layer " + std::to_string(i));
    }
  }
  float* const flat = impl_->weights.mutable_data_ptr<float>();
  for (size_t i = 0; i < network.layers.size(); ++i) {
    if (network.layers[i].op != LayerOp::kConv2d) continue;
    std::copy(network.layers[i].weights.begin(), network.layers[i].weights.end(),
              flat + plan.slots[i].weights);
    std::copy(network.layers[i].bias.begin(), network.layers[i].bias.end(),
              flat + plan.slots[i].bias);
  }
}

}  // namespace figurine::model
