#include "toolchain/model/render.h"

#include "toolchain/tensor_operations.h"

namespace figurine::model {

// Shared by the renderer and the graph's node, so that a backward pass outlives the renderer.
struct RendererState : torch::CustomClassHolder {
  explicit RendererState(const SplatterOptions& chosen) : options(chosen), splatter(chosen) {}

  SplatterOptions options;
  Splatter<float> splatter;
  HeadFrame frame;
  GaussianBuffer<float> gaussians, gradients;
  int64_t renders = 0;  // tells a backward pass whether the buffers are still its own
};

namespace {

class Render : public torch::autograd::Function<Render> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& head,
                               const c10::intrusive_ptr<RendererState>& state,
                               const RenderView& view) {
    torch::Tensor image = torch::empty({4, view.crop.height, view.crop.width});
    decode_head(state->frame, head.const_data_ptr<float>(), state->options.threads,
                state->gaussians);
    state->splatter.forward(state->gaussians.view(), view.camera, view.crop,
                            image.mutable_data_ptr<float>());
    context->save_for_backward({head, image});
    context->saved_data["state"] = c10::IValue::make_capsule(state);
    context->saved_data["render"] = ++state->renders;
    return image;
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list output_gradients) {
    const auto state =
        c10::static_intrusive_pointer_cast<RendererState>(context->saved_data["state"].toCapsule());
    TORCH_CHECK(context->saved_data["render"].toInt() == state->renders,
                "AvatarRenderer: the backward pass must be done before the next render");
    const torch::autograd::variable_list saved = context->get_saved_variables();
    const torch::Tensor &head = saved[0], &image = saved[1],
                        gradient = output_gradients[0].contiguous();
    torch::Tensor head_gradient = torch::empty_like(head);
    state->gradients.resize(state->gaussians.count, state->gaussians.sh_degree);
    state->splatter.backward(image.const_data_ptr<float>(), gradient.const_data_ptr<float>(),
                             state->gradients.gradients());
    decode_head_backward(state->frame, head.const_data_ptr<float>(), state->gradients,
                         state->options.threads, head_gradient.mutable_data_ptr<float>());
    return {head_gradient, {}, {}};
  }
};

}  // namespace

AvatarRenderer::AvatarRenderer(const SplatterOptions& options)
    : state_(c10::make_intrusive<RendererState>(options)) {}
AvatarRenderer::~AvatarRenderer() = default;

torch::Tensor AvatarRenderer::render(const torch::Tensor& head, const HeadFrame& frame,
                                     const RenderView& view) {
  const int64_t texels = frame.body->texel_count(),
                channels = head_channels(frame.decoding.sh_degree);
  TORCH_CHECK(head.scalar_type() == torch::kFloat && head.is_contiguous(),
              "AvatarRenderer: the head must be contiguous floats");
  TORCH_CHECK(head.sizes() == torch::IntArrayRef({texels, channels}),
              "AvatarRenderer: the head must be [", texels, ",", channels, "]");
  state_->frame = frame;
  return Render::apply(head, state_, view);
}

const GaussianBuffer<float>& AvatarRenderer::gaussians() const { return state_->gaussians; }
const SplatterStatistics& AvatarRenderer::statistics() const {
  return state_->splatter.statistics();
}

}  // namespace figurine::model
