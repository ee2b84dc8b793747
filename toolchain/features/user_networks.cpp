#include "toolchain/features/user_networks.h"

#include <torch/csrc/jit/runtime/graph_executor.h>
#include <torch/script.h>

#include <cstring>
#include <filesystem>
#include <map>

#include "ports/host/files.h"
#include "ports/motion/npz.h"
#include "toolchain/error.h"
#include "toolchain/features/perceptual_embedding.h"
#include "toolchain/model/convolution.h"
#include "toolchain/tensor_operations.h"

namespace figurine::features {

namespace {

constexpr int64_t kInceptionSide_px = 299;
constexpr uint32_t kLeastAlexNetSide_px = 31;  // one position is left behind the second pooling

struct AlexNetLayer {
  const char* name;  // in the state of the authors' LPIPS; ".weight" and ".bias"
  int64_t in, out, kernel, stride, padding;
  bool pooled_before;  // greatest of 3 x 3, every second
};
constexpr AlexNetLayer kAlexNet[] = {{"net.slice1.0", 3, 64, 11, 4, 2, false},
                                     {"net.slice2.3", 64, 192, 5, 1, 2, true},
                                     {"net.slice3.6", 192, 384, 3, 1, 1, true},
                                     {"net.slice4.8", 384, 256, 3, 1, 1, false},
                                     {"net.slice5.10", 256, 256, 3, 1, 1, false}};

std::string channel_weights_name(size_t layer) {
  return "lin" + std::to_string(layer) + ".model.1.weight";
}

std::string message_of(const std::exception& error) {
  const auto* torch_error = dynamic_cast<const c10::Error*>(&error);
  return torch_error != nullptr ? torch_error->what_without_backtrace() : error.what();
}

torch::jit::Module load_script(const std::string& path) {
  // What cannot be read is told apart from what is no script.
  if (const auto file = ports::MappedFile::open(path); !file.ok())
    throw InputError(file.status().message());
  try {
    torch::jit::Module module = torch::jit::load(path, torch::kCPU);
    module.eval();
    return module;
  } catch (const std::exception& error) {
    const std::string text = message_of(error);
    throw InputError(path + ": not a TorchScript file: " + text.substr(0, text.find('\n')));
  }
}

// Arrays by their names, out of either kind of file.
class NamedArrays {
 public:
  explicit NamedArrays(const std::string& path) : path_(path) {
    if (std::filesystem::path(path).extension() == ".npz") {
      npz_ = std::make_unique<ports::NpzFile>(value_or_throw(ports::NpzFile::open(path)));
      return;
    }
    const torch::jit::Module module = load_script(path);
    for (const auto& named : module.named_parameters()) script_[named.name] = named.value;
    for (const auto& named : module.named_buffers()) script_[named.name] = named.value;
  }

  torch::Tensor read(const std::string& name, const std::vector<int64_t>& shape) const {
    torch::Tensor tensor;
    if (npz_) {
      const ports::NpyArray array = value_or_throw(npz_->read(name, {shape.begin(), shape.end()}));
      tensor = torch::tensor(array.values, torch::kFloat64).view(shape).to(torch::kFloat32);
    } else {
      const auto found = script_.find(name);
      if (found == script_.end()) throw InputError(path_ + ": " + name + ": no such parameter");
      if (found->second.sizes() != at::IntArrayRef(shape)) {
        throw InputError(path_ + ": " + name + ": shape " + c10::str(found->second.sizes()) +
                         ", expected " + c10::str(at::IntArrayRef(shape)));
      }
      tensor = found->second.detach().to(torch::kFloat32).contiguous().clone();
    }
    if (!torch::isfinite(tensor).all().item<bool>())
      throw InputError(path_ + ": " + name + ": holds a value that is not finite");
    return tensor;
  }

 private:
  std::string path_;
  std::unique_ptr<ports::NpzFile> npz_;
  std::map<std::string, torch::Tensor> script_;
};

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

}  // namespace

struct LpipsAlex::Weights {
  std::string name, file, hash;
  std::vector<torch::Tensor> weight, bias;  // of the layers
  std::vector<LayerWeights> distance;       // of the layers
  torch::Tensor shift, scale;               // [1,3,1,1]

  // pictures: [n,3,H,W] in [0,1]. Differentiable by them.
  std::vector<torch::Tensor> activations(const torch::Tensor& pictures) const;
};

std::vector<torch::Tensor> LpipsAlex::Weights::activations(const torch::Tensor& pictures) const {
  torch::Tensor x = (pictures * 2 - 1 - shift) / scale;
  std::vector<torch::Tensor> out;
  for (size_t l = 0; l < std::size(kAlexNet); ++l) {
    if (kAlexNet[l].pooled_before) x = torch::max_pool2d(x, 3, 2);
    x = torch::relu(model::conv2d(x, weight[l], bias[l], kAlexNet[l].stride, kAlexNet[l].padding));
    out.push_back(x);
  }
  return out;
}

LpipsAlex::LpipsAlex(std::unique_ptr<Weights> weights) : weights_(std::move(weights)) {}
LpipsAlex::LpipsAlex(LpipsAlex&&) noexcept = default;
LpipsAlex::~LpipsAlex() = default;

LpipsAlex LpipsAlex::load(const std::string& path) {
  const NamedArrays arrays(path);
  auto weights = std::make_unique<Weights>();
  weights->name = "LPIPS (AlexNet, " + file_name(path) + ")";
  weights->file = path, weights->hash = hash_of_file(path);
  // The constants of the authors' scaling layer: what ImageNet's mean and deviation are in [-1,1].
  weights->shift = torch::tensor({-0.030f, -0.088f, -0.188f}).view({1, 3, 1, 1});
  weights->scale = torch::tensor({0.458f, 0.448f, 0.450f}).view({1, 3, 1, 1});
  for (size_t l = 0; l < std::size(kAlexNet); ++l) {
    const AlexNetLayer& layer = kAlexNet[l];
    const std::string name = layer.name;
    weights->weight.push_back(
        arrays.read(name + ".weight", {layer.out, layer.in, layer.kernel, layer.kernel}));
    weights->bias.push_back(arrays.read(name + ".bias", {layer.out}));
    const torch::Tensor channel = arrays.read(channel_weights_name(l), {1, layer.out, 1, 1});
    if (channel.min().item<float>() < 0) {
      throw InputError(path + ": " + channel_weights_name(l) +
                       ": holds a negative weight, which LPIPS cannot have");
    }
    weights->distance.push_back({.channels = channel.view({layer.out})});
  }
  return LpipsAlex(std::move(weights));
}

const std::string& LpipsAlex::name() const { return weights_->name; }

nlohmann::json LpipsAlex::describe() const {
  return {{"name", weights_->name}, {"file", weights_->file}, {"hash", weights_->hash}};
}

std::vector<float> LpipsAlex::embedding_of(const RgbView& picture) const {
  if (std::min(picture.width_px, picture.height_px) < kLeastAlexNetSide_px) {
    throw InputError(weights_->file + ": LPIPS needs pictures of at least 31x31, not " +
                     std::to_string(picture.width_px) + "x" + std::to_string(picture.height_px));
  }
  const torch::NoGradGuard no_gradient;
  return perceptual_embedding(weights_->activations(to_tensor(picture)), weights_->distance);
}

uint32_t LpipsAlex::least_side_px() const { return kLeastAlexNetSide_px; }

torch::Tensor LpipsAlex::between(const torch::Tensor& seen, const torch::Tensor& truth) const {
  return perceptual_distance(weights_->activations(torch::stack({seen, truth})),
                             weights_->distance);
}

struct InceptionFeatures::Script {
  std::string name, file, hash;
  mutable torch::jit::Module module;  // forward() is not const, but changes nothing in evaluation
  size_t dimension = 0;

  // [F]
  torch::Tensor run(const torch::Tensor& pictures) const {
    const torch::NoGradGuard no_gradient;
    // The optimiser specialises a graph after its first runs: the first pictures would come out in
    // other bits than the last.
    const torch::jit::GraphOptimizerEnabledGuard as_written(false);
    torch::jit::IValue value;
    try {
      value = module.forward(
          {pictures.contiguous(at::MemoryFormat::ChannelsLast)});  // toolchain/model/convolution.h
    } catch (const std::exception& error) {
      throw InputError(file + ": forward: " + reason(error));
    }
    if (!value.isTensor())
      throw InputError(file + ": forward: gives a " + value.tagKind() +
                       ", expected a tensor [1,F] or [1,F,1,1]");
    const torch::Tensor features = value.toTensor();
    const bool flat = features.dim() == 2,
               pooled = features.dim() == 4 && features.size(2) == 1 && features.size(3) == 1;
    if (!(flat || pooled) || features.size(0) != 1 || features.size(1) < 1) {
      throw InputError(file + ": forward: gives the shape " + c10::str(features.sizes()) +
                       ", expected [1,F] or [1,F,1,1]");
    }
    return features.to(torch::kFloat64).contiguous().view({-1});
  }

  // The last line of an interpreter's message says what happened, those before where.
  static std::string reason(const std::exception& error) {
    std::string text = message_of(error);
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    const size_t last = text.rfind('\n');
    return last == std::string::npos ? text : text.substr(last + 1);
  }
};

InceptionFeatures::InceptionFeatures(const std::string& path)
    : script_(std::make_unique<Script>()) {
  script_->module = load_script(path);
  script_->name = "Inception (" + file_name(path) + ")";
  script_->file = path, script_->hash = hash_of_file(path);
  if (!script_->module.find_method("forward"))
    throw InputError(path + ": forward: the module has no such method");
  script_->dimension = static_cast<size_t>(
      script_->run(torch::zeros({1, 3, kInceptionSide_px, kInceptionSide_px})).numel());
}

InceptionFeatures::~InceptionFeatures() = default;

const std::string& InceptionFeatures::name() const { return script_->name; }

nlohmann::json InceptionFeatures::describe() const {
  return {{"name", script_->name},
          {"file", script_->file},
          {"hash", script_->hash},
          {"dimension", script_->dimension}};
}

size_t InceptionFeatures::dimension() const { return script_->dimension; }

void InceptionFeatures::features_of(const RgbView& picture, std::span<double> features) const {
  const torch::Tensor resized =
      at::upsample_bilinear2d(to_tensor(picture), {kInceptionSide_px, kInceptionSide_px}, false);
  const torch::Tensor row = script_->run(resized * 2 - 1);
  if (static_cast<size_t>(row.numel()) != features.size())
    throw InputError(script_->file + ": forward: gives another number of features now");
  if (!torch::isfinite(row).all().item<bool>())
    throw InputError(script_->file + ": forward: gives a value that is not finite");
  std::memcpy(features.data(), row.data_ptr<double>(), features.size_bytes());
}

}  // namespace figurine::features
