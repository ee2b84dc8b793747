// Other libraries that evaluate an avatar's network, beside figurine's own runners.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "figurine/network.h"

namespace figurine::peers {

class NetworkPeer {
 public:
  virtual ~NetworkPeer() = default;
  // Takes over an input [T,T,C] in whatever layout the library wants; not timed.
  virtual void set_input(std::span<const float> input) = 0;
  virtual void run() = 0;  // timed
  // The head of the last run, [T,T,out]; not timed.
  virtual void get_output(std::span<float> output) = 0;
};

// ONNX Runtime on one thread, all of its optimisations on. path: a model of network_models.py.
// Null, with the reason on standard error, if it cannot be loaded.
std::unique_ptr<NetworkPeer> make_onnx_peer(const std::string& path, const ValueShape& input,
                                            const ValueShape& output);
// LibTorch on one thread, float, channels last, as an inference-mode graph of its own operators.
std::unique_ptr<NetworkPeer> make_torch_peer(const Network& network, const ValueShape& input,
                                             const ValueShape& output);
// Of what this build has: "ONNX Runtime 1.21.0", "LibTorch 2.6.0".
std::string onnx_name();
std::string torch_name();

}  // namespace figurine::peers
