// A network in fixed point: the one arithmetic that trainer, packer, tests and device share
// (docs/numerics.md, "Fixed point").
//
//   real = scale (q - zero_point)
//   weights      int8, symmetric (-127 to 127), one scale per output channel
//   activations  int8, one scale and zero point per value; the input int16 with zero point 0: over
//                a metre, int8 steps are 8 mm
//   sums         int32, exact; the bias is int32 in units of input scale x weight scale
//   convolution  q = clamp(round(float(sum) * multiplier) + zero_point), multiplier = input scale *
//                weight scale / output scale in float32, in this association; ReLU clamps at the
//                zero point. round is to nearest, ties to even
//   max pool, concatenation   the integers as they are: inputs and output share one scale and zero
//                             point
//   upsample     (9 a + 3 b + 3 c + d + 8) >> 4 of the four neighbours, edges repeated: what
//                XNNPACK's 11-bit weights give for x2
//   head         the last layer: float(sum) * (input scale * weight scale), in float, every output
//                with its own weight scale
//
// Based on: Jacob et al., Quantization and Training of Neural Networks for Efficient
// Integer-Arithmetic-Only Inference, 2018, eq. 1-4, with a float multiplier instead of their
// fixed-point one, as XNNPACK has it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/network.h"
#include "figurine/status.h"

namespace figurine {

struct Quantisation {
  float scale = 1;
  int32_t zero_point = 0;
  bool operator==(const Quantisation&) const = default;
};

struct FixedPointConvolution {
  std::span<const int8_t> weights;      // [out, kernel, kernel, in], -127 to 127
  std::span<const float> weight_scale;  // [out]
  std::span<const int32_t> bias;        // [out], in units of input scale x weight scale
};

// Goes with a Network, which says the shapes; its float weights are not used and may be absent.
struct FixedPointNetwork {
  std::vector<FixedPointConvolution> convolutions;  // [layers]; empty spans for the other operators
  std::vector<Quantisation>
      values;  // [layers]: of value 0, the input, to the last but one; the result is float

  bool empty() const { return convolutions.empty(); }
};

inline constexpr int32_t kInt8Min = -128, kInt8Max = 127;
inline constexpr int32_t kWeightMax = 127;
inline constexpr int32_t kInputMax = 32767;  // of the int16 input, either sign

// To nearest, ties to even, for |x| < 2^22: adding 1.5 * 2^23 leaves no fraction bits. No libm.
inline int32_t round_to_int(float x) {
  constexpr float kMagic = 12582912.0f;
  return static_cast<int32_t>((x + kMagic) - kMagic);
}

// clamp(x, low, high) rounded; NaN gives low. Limits within +-2^22.
inline int32_t clamp_and_round(float x, float low, float high) {
  return round_to_int(!(x > low) ? low : x < high ? x : high);
}

inline int8_t quantise_int8(float x, const Quantisation& to) {
  const float zero = static_cast<float>(to.zero_point);
  return static_cast<int8_t>(
      clamp_and_round(x / to.scale, float(kInt8Min) - zero, float(kInt8Max) - zero) +
      to.zero_point);
}
inline int16_t quantise_input(float x, float scale) {
  return static_cast<int16_t>(clamp_and_round(x / scale, -float(kInputMax), float(kInputMax)));
}
inline float dequantise(int32_t q, const Quantisation& from) {
  return from.scale * static_cast<float>(q - from.zero_point);
}

// One association everywhere: XNNPACK's.
inline float requantisation_multiplier(float input_scale, float weight_scale, float output_scale) {
  return input_scale * weight_scale / output_scale;
}

// A convolution's sum to its int8 output. lowest: kInt8Min, or the zero point after a ReLU.
inline int8_t requantise(int32_t sum, float multiplier, int32_t zero_point, int32_t lowest) {
  const float zero = static_cast<float>(zero_point);
  return static_cast<int8_t>(clamp_and_round(static_cast<float>(sum) * multiplier,
                                             float(lowest) - zero, float(kInt8Max) - zero) +
                             zero_point);
}

// Everything that makes the arithmetic above defined and exact, so that an evaluation cannot fail:
// counts; finite positive normal scales, of sums too; zero points in range; weights in -127 to 127;
// no sum can overflow int32; multipliers within XNNPACK's range (2^-32 to 256); pool, upsample and
// concatenation with equal quantisation on all sides; value 0 read by convolutions alone, with zero
// point 0; the last layer a convolution without ReLU whose result nobody reads. kCorrupt "fixed
// point: layer N: ...".
Status validate_fixed_point(const Network& network, const FixedPointNetwork& fixed);
// The part of it that no weights are needed for: the values' count, scales, zero points and ties,
// and the last layer.
Status validate_quantisation(const Network& network, std::span<const Quantisation> values);

// What one evaluation made of every value, for tests and for the trainer.
struct FixedPointValues {
  std::vector<std::vector<int8_t>>
      values;  // [layers + 1] of [size,size,channels]; empty for the input and the result
  std::vector<float> result;  // [size,size,out] of the last layer
};

// The specification: plain loops, any CPU, the same bits. input: [T,T,C] int16. The network must be
// valid (FIG_CHECK on sizes only).
FixedPointValues evaluate_fixed_point(const Network& network, const FixedPointNetwork& fixed,
                                      std::span<const int16_t> input);

}  // namespace figurine
