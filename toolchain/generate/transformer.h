// The transformer that predicts clean weights from noisy ones: the paper's second network.
//
//   t_l = Proj_l(z_l) + position_l          one linear layer a token, because tokens have different
//       lengths
//   t_time = MLP(sinusoids of lambda)       a token of its own, first (HyperDiffusion)
//   blocks: t += Attention(LayerNorm(t));  t += W2 GELU(W1 LayerNorm(t))
//   x_l = Unproj_l(LayerNorm(t_l))
//
// lambda = ln(alpha / sigma), half the log of the signal-to-noise ratio, is the only time there is:
// the network knows no number of steps. All parameters live in one flat tensor (flat_parameters.h).
//
// What comes out of the last layer is the clean values, or, of kVelocity, the way from them to the
// noise on a straight line, as in flow matching. With t = sigma / (alpha + sigma):
//
//   y = (1 - t) x + t eps = z / (alpha + sigma);   v = eps - x = F(y, lambda);   x = y - t v
//
// Based on: the paper, section 4.2; Erkoc et al., HyperDiffusion, 2023; Radford et al., GPT-2, 2019
// (pre-norm blocks); Lipman et al., Flow matching, 2023; Srivastava et al., Dropout, 2014.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/generate/flat_parameters.h"
#include "toolchain/tensor.h"

namespace figurine::generate {

enum class Prediction : uint8_t { kClean, kVelocity };
const char* to_string(Prediction prediction);                // "clean", "velocity"
Prediction prediction_from_string(const std::string& name);  // throws InputError

struct TransformerShape {
  Prediction prediction = Prediction::kClean;
  std::vector<int64_t> token_sizes;  // [L]
  int64_t d_model = 512;
  int64_t blocks = 12;
  int64_t heads = 16;
  int64_t feed_forward = 2048;
};

// Throws InputError naming the field: nothing positive, heads that do not divide d_model, an odd
// d_model.
void check(const TransformerShape& shape);
nlohmann::json to_json(const TransformerShape& shape);
TransformerShape shape_from_json(const nlohmann::json& json, const std::string& where);
// Counted from the shape; the network need not be built.
uint64_t parameter_count(const TransformerShape& shape);
// Multiply-accumulates of one evaluation of one vector.
uint64_t mac_count(const TransformerShape& shape);

class Transformer {
 public:
  // Weights from the seed: linear layers uniform in +-1/sqrt(inputs), positions normal of deviation
  // 0.02, Unproj zero, so that the first prediction is the mean of the training members.
  Transformer(const TransformerShape& shape, uint64_t seed);
  ~Transformer();
  Transformer(const Transformer&) = delete;
  Transformer& operator=(const Transformer&) = delete;

  // z: [B,D] noisy values; lambda: [B], finite. Returns the predicted clean values [B,D],
  // differentiable by the weights. bf16: matrix products in bfloat16, sums, norms and results in
  // float. dropout: the share of what blocks add to a token that is left out, the rest scaled up;
  // drawn by LibTorch's own generator, which the caller seeds.
  torch::Tensor forward(const torch::Tensor& z, const torch::Tensor& lambda, bool bf16 = false,
                        double dropout = 0) const;

  torch::Tensor& weights();    // [P] flat; assign into it in place only
  torch::Tensor& gradients();  // [P] flat; backward passes add to it
  const FlatLayout& layout() const;
  const TransformerShape& shape() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// t of kVelocity for every lambda: [B], of z's kind.
torch::Tensor noise_share(const torch::Tensor& lambda);

// [B] to [B,width]: sines, then cosines, of lambda times width / 2 frequencies, geometric from 1/20
// to 20 radians a unit: the slowest turns once over every range in use, the fastest tells steps
// apart that are a hundredth of it.
torch::Tensor embed_lambda(const torch::Tensor& lambda, int64_t width);

}  // namespace figurine::generate
