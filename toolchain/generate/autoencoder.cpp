#include "toolchain/generate/autoencoder.h"

#include <cmath>
#include <limits>

#include "toolchain/error.h"
#include "toolchain/generate/tensors.h"
#include "toolchain/model/convolution.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generate {

using measure::RowMatrix;

namespace {

constexpr int64_t kReduction = 8;  // of the picture's side: three strides of 2
constexpr int64_t kWidths[] = {16, 32, 64};
constexpr int64_t kGroups = 8;              // of the residual blocks' norms
constexpr double kLargestLogVariance = 20;  // beyond it exp says nothing more
constexpr Eigen::Index kRowsAtOnce = 64;
constexpr uint64_t kPosteriorNoise = 11;  // a stream of draws, apart from the denoiser's

int64_t side_of(size_t width) {
  const auto side = static_cast<int64_t>(std::ceil(std::sqrt(static_cast<double>(width))));
  return (side + kReduction - 1) / kReduction * kReduction;
}

void add_convolution(FlatLayout& layout, const std::string& name, std::vector<int64_t> shape,
                     int64_t out) {
  layout.add(name + ".weight", std::move(shape));
  layout.add(name + ".bias", {out});
}

void add_residual_block(FlatLayout& layout, const std::string& name, int64_t width) {
  for (const char* part : {".0", ".1"}) {
    layout.add(name + part + ".norm.weight", {width}),
        layout.add(name + part + ".norm.bias", {width});
    add_convolution(layout, name + part, {width, width, 3, 3}, width);
  }
}

FlatLayout layout_of(int64_t channels) {
  FlatLayout layout;
  int64_t in = 1;
  for (size_t i = 0; i < std::size(kWidths); ++i) {
    add_convolution(layout, "encoder.down." + std::to_string(i), {kWidths[i], in, 3, 3},
                    kWidths[i]);
    in = kWidths[i];
  }
  add_residual_block(layout, "encoder.block", in);
  add_convolution(layout, "encoder.out", {2 * channels, in, 3, 3}, 2 * channels);
  add_convolution(layout, "decoder.in", {in, channels, 3, 3}, in);
  add_residual_block(layout, "decoder.block", in);
  const int64_t up[] = {kWidths[1], kWidths[0], 1};
  for (size_t i = 0; i < std::size(up); ++i) {
    add_convolution(layout, "decoder.up." + std::to_string(i), {in, up[i], 4, 4}, up[i]);
    in = up[i];
  }
  return layout;
}

// Weights in the order of the layout.
struct Reader {
  const FlatParameters& parameters;
  size_t at;

  const torch::Tensor& next() { return parameters.leaf(at++); }
  torch::Tensor convolution(const torch::Tensor& x, int64_t stride) {
    const torch::Tensor &weight = next(), &bias = next();
    return model::conv2d(x, weight, bias, stride, /*padding=*/1);
  }
  torch::Tensor transposed(const torch::Tensor& x) {
    const torch::Tensor &weight = next(), &bias = next();
    return model::conv_transpose2d(x, weight, bias, /*stride=*/2, /*padding=*/1);
  }
  torch::Tensor residual_block(const torch::Tensor& x) {
    torch::Tensor y = x;
    for (int i = 0; i < 2; ++i) {
      const torch::Tensor &weight = next(), &bias = next();
      y = convolution(torch::silu(torch::group_norm(y, kGroups, weight, bias)), 1);
    }
    return x + y;
  }
};

size_t first_of_decoder(const FlatLayout& layout) {
  for (size_t i = 0; i < layout.list().size(); ++i) {
    if (layout.list()[i].name.starts_with("decoder.")) return i;
  }
  throw std::logic_error("an autoencoder without a decoder");
}

}  // namespace

Autoencoder::Autoencoder(size_t width, const AutoencoderSettings& settings, uint64_t seed)
    : width_(static_cast<int64_t>(width)),
      channels_(settings.channels),
      side_(side_of(width)),
      parameters_(layout_of(settings.channels)) {
  if (channels_ < 1)
    throw InputError("sampler: autoencoder: channels: " + std::to_string(channels_) +
                     " is not positive");
  token_sizes_.assign(static_cast<size_t>(latent_side()),
                      static_cast<size_t>(channels_ * latent_side()));
  const torch::NoGradGuard no_gradient;
  auto generator = at::make_generator<at::CPUGeneratorImpl>(seed);
  double bound = 0;  // of the weight before: its bias has the same
  const std::vector<FlatParameter>& list = parameters_.layout().list();
  for (size_t i = 0; i < list.size(); ++i) {
    torch::Tensor values = parameters_.leaf(i);
    if (list[i].name.find("norm") != std::string::npos) {
      values.fill_(list[i].name.ends_with("weight") ? 1 : 0);
      continue;
    }
    // Every output of a transposed convolution of stride 2 sees a quarter of its 4x4 taps.
    const bool up = list[i].name.starts_with("decoder.up");
    if (list[i].name.ends_with("weight")) {
      const auto inputs = static_cast<double>(
          up ? list[i].shape[0] * 4 : list[i].shape[1] * list[i].shape[2] * list[i].shape[3]);
      bound = 1 / std::sqrt(inputs);
    }
    values.uniform_(-bound, bound, generator);
  }
}

Autoencoder::Posterior Autoencoder::posterior(const torch::Tensor& z) const {
  Reader reader{parameters_, 0};
  torch::Tensor x =
      torch::constant_pad_nd(z, {0, side_ * side_ - width_}).view({z.size(0), 1, side_, side_});
  for (size_t i = 0; i < std::size(kWidths); ++i) x = torch::silu(reader.convolution(x, 2));
  x = reader.residual_block(x);
  const std::vector<torch::Tensor> halves = reader.convolution(x, 1).chunk(2, 1);
  return {halves[0], halves[1].clamp(-kLargestLogVariance, kLargestLogVariance)};
}

torch::Tensor Autoencoder::reconstruct(const torch::Tensor& map) const {
  Reader reader{parameters_, first_of_decoder(parameters_.layout())};
  torch::Tensor x = reader.residual_block(reader.convolution(map, 1));
  for (size_t i = 0; i < std::size(kWidths); ++i) x = reader.transposed(torch::silu(x));
  return x.reshape({map.size(0), side_ * side_}).narrow(1, 0, width_);
}

RowMatrix Autoencoder::encode(const RowMatrix& z) const {
  const torch::NoGradGuard no_gradient;
  const int64_t s = latent_side();
  RowMatrix out(z.rows(), channels_ * s * s);
  for (Eigen::Index first = 0; first < z.rows(); first += kRowsAtOnce) {
    const Eigen::Index count = std::min(kRowsAtOnce, z.rows() - first);
    // [B,C,S,S] to rows of the map, all channels of a row together: a token.
    const torch::Tensor map =
        posterior(to_tensor(z.middleRows(first, count))).mean.permute({0, 2, 1, 3});
    out.middleRows(first, count) = to_rows(map.reshape({count, channels_ * s * s}));
  }
  return out;
}

RowMatrix Autoencoder::decode(const RowMatrix& latents) const {
  const torch::NoGradGuard no_gradient;
  const int64_t s = latent_side();
  RowMatrix out(latents.rows(), width_);
  for (Eigen::Index first = 0; first < latents.rows(); first += kRowsAtOnce) {
    const Eigen::Index count = std::min(kRowsAtOnce, latents.rows() - first);
    const torch::Tensor map = to_tensor(latents.middleRows(first, count))
                                  .view({count, s, channels_, s})
                                  .permute({0, 2, 1, 3});
    out.middleRows(first, count) = to_rows(reconstruct(map.contiguous()));
  }
  return out;
}

Autoencoding::Autoencoding(std::shared_ptr<Autoencoder> autoencoder,
                           const SamplerSettings& settings, const RowMatrix& training,
                           const RowMatrix& validation)
    : autoencoder_(std::move(autoencoder)),
      settings_(settings),
      training_(to_tensor(training)),
      validation_(to_tensor(validation)),
      order_(settings.seed + 1, static_cast<size_t>(training.rows())) {}

torch::Tensor Autoencoding::loss(uint64_t iteration, Share share) {
  const int64_t s = autoencoder_->latent_side();
  std::vector<torch::Tensor> z, noise;
  for (int64_t row = 0; row < share.count; ++row) {
    const uint64_t counter = iteration * settings_.batch + static_cast<uint64_t>(share.first + row);
    z.push_back(training_[static_cast<int64_t>(order_.item(counter))]);
    noise.push_back(
        draw_noise(settings_.seed, kPosteriorNoise, counter, autoencoder_->channels() * s * s));
  }
  const torch::Tensor clean = torch::stack(z);
  const Autoencoder::Posterior posterior = autoencoder_->posterior(clean);
  const torch::Tensor map = posterior.mean + torch::exp(0.5 * posterior.log_variance) *
                                                 torch::stack(noise).view_as(posterior.mean);
  const torch::Tensor kl =
      0.5 *
      (posterior.mean.square() + posterior.log_variance.exp() - 1 - posterior.log_variance).mean();
  return torch::mse_loss(autoencoder_->reconstruct(map), clean) +
         settings_.autoencoder.kl_weight * kl;
}

double Autoencoding::validation_loss() {
  if (validation_.size(0) == 0) return std::numeric_limits<double>::quiet_NaN();
  return torch::mse_loss(autoencoder_->reconstruct(autoencoder_->posterior(validation_).mean),
                         validation_)
      .item<double>();
}

}  // namespace figurine::generate
