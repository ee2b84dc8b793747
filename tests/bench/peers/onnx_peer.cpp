#include <onnxruntime_cxx_api.h>

#include <cstdio>
#include <vector>

#include "bench/peers/network_peer.h"

namespace figurine::peers {
namespace {

class OnnxPeer final : public NetworkPeer {
 public:
  OnnxPeer(const std::string& path, const ValueShape& input, const ValueShape& output)
      : environment_(ORT_LOGGING_LEVEL_WARNING, "network_peers"),
        session_(environment_, path.c_str(), options()),
        in_(input),
        out_(output),
        input_(size_t{input.size} * input.size * input.channels),
        output_(size_t{output.size} * output.size * output.channels) {
    const int64_t in_shape[] = {1, input.channels, input.size, input.size},
                  out_shape[] = {1, output.channels, output.size, output.size};
    const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
    in_value_ = Ort::Value::CreateTensor<float>(memory, input_.data(), input_.size(), in_shape, 4);
    out_value_ =
        Ort::Value::CreateTensor<float>(memory, output_.data(), output_.size(), out_shape, 4);
  }

  // To channels first.
  void set_input(std::span<const float> input) override {
    const size_t pixels = size_t{in_.size} * in_.size;
    for (size_t p = 0; p < pixels; ++p) {
      for (size_t c = 0; c < in_.channels; ++c)
        input_[c * pixels + p] = input[p * in_.channels + c];
    }
  }
  void run() override {
    const char* const in_name = "input";
    const char* const out_name = "output";
    session_.Run(Ort::RunOptions{nullptr}, &in_name, &in_value_, 1, &out_name, &out_value_, 1);
  }
  void get_output(std::span<float> output) override {
    const size_t pixels = size_t{out_.size} * out_.size;
    for (size_t p = 0; p < pixels; ++p) {
      for (size_t c = 0; c < out_.channels; ++c)
        output[p * out_.channels + c] = output_[c * pixels + p];
    }
  }

 private:
  static Ort::SessionOptions options() {
    Ort::SessionOptions options;
    options.SetIntraOpNumThreads(1);
    options.SetInterOpNumThreads(1);
    options.SetExecutionMode(ORT_SEQUENTIAL);
    options.SetGraphOptimizationLevel(ORT_ENABLE_ALL);
    return options;
  }

  Ort::Env environment_;
  Ort::Session session_;
  ValueShape in_, out_;
  std::vector<float> input_, output_;
  Ort::Value in_value_{nullptr}, out_value_{nullptr};
};

}  // namespace

std::unique_ptr<NetworkPeer> make_onnx_peer(const std::string& path, const ValueShape& input,
                                            const ValueShape& output) {
  try {
    return std::make_unique<OnnxPeer>(path, input, output);
  } catch (const Ort::Exception& error) {
    std::fprintf(stderr, "network_peers: %s: %s\n", path.c_str(), error.what());
    return nullptr;
  }
}

std::string onnx_name() { return "ONNX Runtime " + Ort::GetVersionString(); }

}  // namespace figurine::peers
