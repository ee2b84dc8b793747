#include "toolchain/generate/transformer.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generate {

namespace {

constexpr double kSlowest = 1.0 / 20, kFastest = 20;  // radians a unit of lambda
constexpr double kPositionDeviation = 0.02;

// Names and shapes of all parameters, in the order of the flat tensor.
FlatLayout layout_of(const TransformerShape& shape) {
  FlatLayout layout;
  const auto add = [&](const std::string& name, std::vector<int64_t> size) {
    layout.add(name, std::move(size));
  };
  const int64_t d = shape.d_model, tokens = static_cast<int64_t>(shape.token_sizes.size());
  for (int64_t l = 0; l < tokens; ++l) {
    add("proj." + std::to_string(l) + ".weight", {d, shape.token_sizes[static_cast<size_t>(l)]});
    add("proj." + std::to_string(l) + ".bias", {d});
  }
  add("position", {tokens + 1, d});
  add("time.in.weight", {d, d}), add("time.in.bias", {d}), add("time.out.weight", {d, d}),
      add("time.out.bias", {d});
  for (int64_t b = 0; b < shape.blocks; ++b) {
    const std::string block = "block." + std::to_string(b);
    add(block + ".norm_attention.weight", {d}), add(block + ".norm_attention.bias", {d});
    add(block + ".qkv.weight", {3 * d, d}), add(block + ".qkv.bias", {3 * d});
    add(block + ".attended.weight", {d, d}), add(block + ".attended.bias", {d});
    add(block + ".norm_feed_forward.weight", {d}), add(block + ".norm_feed_forward.bias", {d});
    add(block + ".feed_in.weight", {shape.feed_forward, d}),
        add(block + ".feed_in.bias", {shape.feed_forward});
    add(block + ".feed_out.weight", {d, shape.feed_forward}), add(block + ".feed_out.bias", {d});
  }
  add("norm.weight", {d}), add("norm.bias", {d});
  for (int64_t l = 0; l < tokens; ++l) {
    add("unproj." + std::to_string(l) + ".weight", {shape.token_sizes[static_cast<size_t>(l)], d});
    add("unproj." + std::to_string(l) + ".bias", {shape.token_sizes[static_cast<size_t>(l)]});
  }
  return layout;
}

constexpr std::pair<Prediction, const char*> kPredictions[] = {{Prediction::kClean, "clean"},
                                                               {Prediction::kVelocity, "velocity"}};

bool ends_with(const std::string& text, const char* end) { return text.ends_with(end); }

}  // namespace

const char* to_string(Prediction prediction) {
  return kPredictions[static_cast<size_t>(prediction)].second;
}

Prediction prediction_from_string(const std::string& name) {
  for (const auto& [prediction, own] : kPredictions) {
    if (name == own) return prediction;
  }
  throw InputError("sampler: prediction: '" + name + "' is neither clean nor velocity");
}

void check(const TransformerShape& shape) {
  if (shape.token_sizes.empty()) throw InputError("sampler: token_sizes: there are none");
  for (const int64_t size : shape.token_sizes) {
    if (size < 1)
      throw InputError("sampler: token_sizes: " + std::to_string(size) + " is no length");
  }
  const std::pair<const char*, int64_t> sizes[] = {{"d_model", shape.d_model},
                                                   {"blocks", shape.blocks},
                                                   {"heads", shape.heads},
                                                   {"feed_forward", shape.feed_forward}};
  for (const auto& [name, value] : sizes) {
    if (value < 1)
      throw InputError("sampler: " + std::string(name) + ": " + std::to_string(value) +
                       " is not positive");
  }
  if (shape.d_model % (2 * shape.heads) != 0) {
    throw InputError("sampler: d_model: " + std::to_string(shape.d_model) +
                     " is no multiple of twice the " + std::to_string(shape.heads) + " heads");
  }
}

nlohmann::json to_json(const TransformerShape& shape) {
  return {{"prediction", to_string(shape.prediction)},
          {"token_sizes", shape.token_sizes},
          {"d_model", shape.d_model},
          {"blocks", shape.blocks},
          {"heads", shape.heads},
          {"feed_forward", shape.feed_forward}};
}

TransformerShape shape_from_json(const nlohmann::json& json, const std::string& where) {
  TransformerShape shape;
  try {
    // Runs before flow matching say nothing.
    shape.prediction = prediction_from_string(json.value("prediction", "clean"));
    shape.token_sizes = json.at("token_sizes").get<std::vector<int64_t>>();
    shape.d_model = json.at("d_model").get<int64_t>(),
    shape.blocks = json.at("blocks").get<int64_t>();
    shape.heads = json.at("heads").get<int64_t>(),
    shape.feed_forward = json.at("feed_forward").get<int64_t>();
  } catch (const nlohmann::json::exception& error) {
    throw InputError(where + ": " + error.what());
  }
  check(shape);
  return shape;
}

uint64_t parameter_count(const TransformerShape& shape) {
  return static_cast<uint64_t>(layout_of(shape).count());
}

uint64_t mac_count(const TransformerShape& shape) {
  const auto d = static_cast<uint64_t>(shape.d_model), tokens = shape.token_sizes.size() + 1;
  uint64_t values = 0;
  for (const int64_t size : shape.token_sizes) values += static_cast<uint64_t>(size);
  const uint64_t token =
      4 * d * d + 2 * d * static_cast<uint64_t>(shape.feed_forward) + 2 * tokens * d;
  return 2 * values * d + 2 * d * d + static_cast<uint64_t>(shape.blocks) * tokens * token;
}

torch::Tensor embed_lambda(const torch::Tensor& lambda, int64_t width) {
  const int64_t half = width / 2;
  const torch::Tensor step = torch::arange(half, torch::kFloat64) / std::max<int64_t>(1, half - 1);
  const torch::Tensor frequency = kSlowest * torch::exp(step * std::log(kFastest / kSlowest));
  const torch::Tensor angle = lambda.to(torch::kFloat64).unsqueeze(1) * frequency;
  return torch::cat({angle.sin(), angle.cos()}, 1).to(torch::kFloat32);
}

torch::Tensor noise_share(const torch::Tensor& lambda) {
  return (1 / (1 + lambda.to(torch::kFloat64).exp())).to(torch::kFloat32);
}

struct Transformer::Impl {
  TransformerShape shape;
  FlatParameters parameters;
  const std::vector<int64_t>& splits = shape.token_sizes;

  explicit Impl(const TransformerShape& own) : shape(own), parameters(layout_of(own)) {}

  // A reader of the parameters in the order of the list.
  struct Reader {
    const Impl& impl;
    size_t at;
    bool bf16;
    const torch::Tensor& next() { return impl.parameters.leaf(at++); }
    torch::Tensor linear(const torch::Tensor& x) {
      const torch::Tensor &weight = next(), &bias = next();
      if (!bf16) return torch::linear(x, weight, bias);
      return torch::linear(x.to(torch::kBFloat16), weight.to(torch::kBFloat16))
                 .to(torch::kFloat32) +
             bias;
    }
    torch::Tensor norm(const torch::Tensor& x) {
      const torch::Tensor &weight = next(), &bias = next();
      return torch::layer_norm(x, {impl.shape.d_model}, weight, bias);
    }
  };

  torch::Tensor attention(Reader& reader, const torch::Tensor& t) const {
    const int64_t batch = t.size(0), tokens = t.size(1), width = shape.d_model / shape.heads;
    const auto qkv = reader.linear(t)
                         .view({batch, tokens, 3, shape.heads, width})
                         .permute({2, 0, 3, 1, 4})
                         .unbind(0);
    const torch::Tensor scores = torch::matmul(qkv[0], qkv[1].transpose(-2, -1)) *
                                 (1 / std::sqrt(static_cast<double>(width)));
    const torch::Tensor mixed = torch::matmul(torch::softmax(scores, -1), qkv[2]);
    return reader.linear(mixed.transpose(1, 2).reshape({batch, tokens, shape.d_model}));
  }

  torch::Tensor forward(const torch::Tensor& z, const torch::Tensor& lambda, bool bf16,
                        double dropout) const {
    if (shape.prediction == Prediction::kClean) return last_layer(z, lambda, bf16, dropout);
    const torch::Tensor t = noise_share(lambda).unsqueeze(1);
    const torch::Tensor y = z * torch::sqrt(t * t + (1 - t) * (1 - t));  // 1 / (alpha + sigma)
    return y - t * last_layer(y, lambda, bf16, dropout);
  }

  torch::Tensor last_layer(const torch::Tensor& z, const torch::Tensor& lambda, bool bf16,
                           double dropout) const {
    const auto kept = [&](const torch::Tensor& added) {
      return dropout > 0 ? torch::dropout(added, dropout, true) : added;
    };
    Reader reader{*this, 0, bf16};
    std::vector<torch::Tensor> tokens{torch::Tensor()};
    for (const torch::Tensor& part : z.split_with_sizes(splits, 1))
      tokens.push_back(reader.linear(part));
    const torch::Tensor position = reader.next();
    tokens[0] = reader.linear(embed_lambda(lambda, shape.d_model));
    tokens[0] = reader.linear(torch::silu(tokens[0]));
    torch::Tensor t = torch::stack(tokens, 1) + position;
    for (int64_t b = 0; b < shape.blocks; ++b) {
      const torch::Tensor normed = reader.norm(t);
      t = t + kept(attention(reader, normed));
      const torch::Tensor hidden = reader.linear(reader.norm(t));
      t = t + kept(reader.linear(torch::gelu(hidden)));
    }
    t = reader.norm(t);
    std::vector<torch::Tensor> out;
    for (size_t l = 0; l < splits.size(); ++l)
      out.push_back(reader.linear(t.select(1, static_cast<int64_t>(l) + 1)));
    return torch::cat(out, 1);
  }
};

Transformer::Transformer(const TransformerShape& shape, uint64_t seed) {
  check(shape);
  impl_ = std::make_unique<Impl>(shape);
  const torch::NoGradGuard no_gradient;
  auto generator = at::make_generator<at::CPUGeneratorImpl>(seed);
  double bound = 0;  // of the weight before: its bias has the same
  const std::vector<FlatParameter>& list = impl_->parameters.layout().list();
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string& name = list[i].name;
    torch::Tensor values = impl_->parameters.leaf(i);
    if (name.find("norm") != std::string::npos) {
      values.fill_(ends_with(name, "weight") ? 1 : 0);
    } else if (name == "position") {
      values.normal_(0, kPositionDeviation, generator);
    } else if (!name.starts_with("unproj")) {
      if (ends_with(name, "weight"))
        bound = 1 / std::sqrt(static_cast<double>(list[i].shape.back()));
      values.uniform_(-bound, bound, generator);
    }
  }
}

Transformer::~Transformer() = default;

torch::Tensor Transformer::forward(const torch::Tensor& z, const torch::Tensor& lambda, bool bf16,
                                   double dropout) const {
  return impl_->forward(z, lambda, bf16, dropout);
}
torch::Tensor& Transformer::weights() { return impl_->parameters.weights(); }
torch::Tensor& Transformer::gradients() { return impl_->parameters.gradients(); }
const FlatLayout& Transformer::layout() const { return impl_->parameters.layout(); }
const TransformerShape& Transformer::shape() const { return impl_->shape; }

}  // namespace figurine::generate
