#include <arm_neon.h>
#include <sys/auxv.h>

#include "bench/roofline/peaks.h"

namespace figurine::roofline {
namespace {

constexpr int kChains = 12;
constexpr unsigned long kDotProduct = 1ul << 20;  // HWCAP_ASIMDDP

uint64_t int8_neon(uint64_t rounds, float* sink) {
  int32x4_t x[kChains];
  for (int c = 0; c < kChains; ++c) x[c] = vdupq_n_s32(c);
  const int16x8_t weights = vdupq_n_s16(3);
  for (uint64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c)
      x[c] = vmlal_s16(x[c], vreinterpret_s16_s32(vget_low_s32(x[c])), vget_low_s16(weights));
  }
  for (int c = 0; c < kChains; ++c) *sink += static_cast<float>(vgetq_lane_s32(x[c], 0));
  return rounds * kChains * 4;
}

__attribute__((target("+dotprod"))) uint64_t int8_sdot(uint64_t rounds, float* sink) {
  int32x4_t x[kChains];
  for (int c = 0; c < kChains; ++c) x[c] = vdupq_n_s32(c);
  const int8x16_t a = vdupq_n_s8(2), b = vdupq_n_s8(3);
  for (uint64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c) x[c] = vdotq_s32(x[c], a, b);
  }
  for (int c = 0; c < kChains; ++c) *sink += static_cast<float>(vgetq_lane_s32(x[c], 0));
  return rounds * kChains * 16;
}

uint64_t float_neon(uint64_t rounds, float* sink) {
  float32x4_t x[kChains];
  for (int c = 0; c < kChains; ++c) x[c] = vdupq_n_f32(static_cast<float>(c));
  const float32x4_t a = vdupq_n_f32(0.5f), b = vdupq_n_f32(0.25f);
  for (uint64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c) x[c] = vfmaq_f32(x[c], a, b);
  }
  for (int c = 0; c < kChains; ++c) *sink += vgetq_lane_f32(x[c], 0);
  return rounds * kChains * 4;
}

uint64_t blend_neon(uint64_t rounds, float* sink) {
  float32x4_t x[kChains];
  for (int c = 0; c < kChains; ++c) x[c] = vdupq_n_f32(static_cast<float>(c));
  const float32x4_t half = vdupq_n_f32(0.5f), one = vdupq_n_f32(1), low = vdupq_n_f32(0),
                    high = vdupq_n_f32(9);
  for (uint64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c)
      x[c] = vmaxq_f32(vminq_f32(vaddq_f32(vmulq_f32(x[c], half), one), high), low);
  }
  for (int c = 0; c < kChains; ++c) *sink += vgetq_lane_f32(x[c], 0);
  return rounds * kChains * 4 * 4;
}

}  // namespace

std::vector<Peak> int8_macs() {
  std::vector<Peak> peaks = {{"neon", int8_neon}};
  if ((::getauxval(AT_HWCAP) & kDotProduct) != 0) peaks.push_back({"sdot", int8_sdot});
  return peaks;
}
std::vector<Peak> float_macs() { return {{"neon", float_neon}}; }
std::vector<Peak> blend_operations() { return {{"baseline", blend_neon}, {"neon", blend_neon}}; }

}  // namespace figurine::roofline
