// A network as a list of layers: enough for the pose UNets of every preset and for other shapes of
// the same operators.
//
// Value 0 is the input, value i + 1 the output of layer i; the last value is the result. All values
// are NHWC with batch 1. Resolution and channels of every value follow from the list
// (infer_shapes).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/status.h"

namespace figurine {

enum class LayerOp : uint8_t {
  kConv2d,  // kernel x kernel, stride 1, zero padding kernel/2, bias, optional ReLU; weights [out,
            // kernel, kernel, in] (OHWI)
  kMaxPool2,   // 2x2, stride 2
  kUpsample2,  // bilinear x2, half-pixel centres (align_corners = false)
  kConcat,     // of two values of one size, channels of inputs[0] first
};

struct Layer {
  LayerOp op = LayerOp::kConv2d;
  uint32_t inputs[2] = {0, 0};     // the second is used by kConcat only
  uint32_t out_channels = 0;       // kConv2d only
  uint32_t kernel = 0;             // kConv2d only: 1 or 3
  bool relu = false;               // kConv2d only
  std::span<const float> weights;  // [out, kernel, kernel, in]
  std::span<const float> bias;     // [out]
};

struct ValueShape {
  uint32_t size = 0;  // side, pixels
  uint32_t channels = 0;
};

struct Network {
  uint32_t input_size = 0;  // T
  uint32_t input_channels = 0;
  std::vector<Layer> layers;
};

inline constexpr uint32_t kMaxLayers = 256;
inline constexpr uint32_t kMaxChannels = 4096;

// Shapes of all values, input first. kCorrupt if an input is not an earlier value, sizes do not fit
// (odd pooling, unequal concat), a limit is exceeded, or (when check_weights) the number of weights
// is not what the shapes say.
Result<std::vector<ValueShape>> infer_shapes(const Network& network, bool check_weights);

// Multiply-accumulates of one evaluation (convolutions only).
uint64_t count_macs(const Network& network, const std::vector<ValueShape>& shapes);
uint64_t count_parameters(const Network& network);
// Whether any convolution has its float weights; a sound network has all or none.
bool has_weights(const Network& network);

// The pose UNet (docs/numerics.md, "Network"): four resolutions, C channels, two 3x3 convolutions
// each on the way down, three up-steps of upsample, concat [skip, up], 3x3 2C -> C, 3x3 C -> C, and
// a 1x1 head. 15 convolutions; weights are left empty.
Network make_pose_unet(uint32_t uv_size, uint32_t input_channels, uint32_t channels,
                       uint32_t output_channels);

// Output channels of the head: canonical offset 3, log-scale 3, quaternion 4 (wxyz), opacity logit
// 1, SH 3 (d+1)^2 (coefficient-major, RGB innermost).
constexpr uint32_t head_channels(uint32_t sh_degree) {
  return 11 + 3 * (sh_degree + 1) * (sh_degree + 1);
}

}  // namespace figurine
