#include <immintrin.h>

#include "bench/roofline/peaks.h"

namespace figurine::roofline {
namespace {

// Chains that do not wait for each other: more than latency times throughput of any operation here
// (4 cycles, 2 a cycle), few enough for sixteen registers beside four constants.
constexpr int kChains = 12;

// LOOP(name, target, vector, start, step, operations a chain and round, what is left of a vector)
#define LOOP(name, isa, vector, start, step, operations, rest)                \
  __attribute__((target(isa))) uint64_t name(uint64_t rounds, float* sink) {  \
    vector x[kChains];                                                        \
    for (int c = 0; c < kChains; ++c) x[c] = start;                           \
    for (uint64_t r = 0; r < rounds; ++r) {                                   \
      _Pragma("GCC unroll 12") for (int c = 0; c < kChains; ++c) x[c] = step; \
    }                                                                         \
    for (int c = 1; c < kChains; ++c) *sink += rest;                          \
    return rounds * kChains * (operations);                                   \
  }

// ---- int8 ---------------------------------------------------------------------------------------

LOOP(int8_sse41, "sse4.1", __m128i, _mm_set1_epi32(c),
     _mm_add_epi32(x[c], _mm_madd_epi16(x[c], _mm_set1_epi16(3))), 8,
     static_cast<float>(_mm_cvtsi128_si32(x[c])))
LOOP(int8_avx2, "avx2", __m256i, _mm256_set1_epi32(c),
     _mm256_add_epi32(x[c], _mm256_madd_epi16(x[c], _mm256_set1_epi16(3))), 16,
     static_cast<float>(_mm_cvtsi128_si32(_mm256_castsi256_si128(x[c]))))
LOOP(int8_avxvnni, "avx2,avxvnni", __m256i, _mm256_set1_epi32(c),
     _mm256_dpbusd_avx_epi32(x[c], _mm256_set1_epi8(2), _mm256_set1_epi8(3)), 32,
     static_cast<float>(_mm_cvtsi128_si32(_mm256_castsi256_si128(x[c]))))
LOOP(int8_avx512, "avx512f,avx512bw", __m512i, _mm512_set1_epi32(c),
     _mm512_add_epi32(x[c], _mm512_madd_epi16(x[c], _mm512_set1_epi16(3))), 32,
     static_cast<float>(_mm_cvtsi128_si32(_mm512_castsi512_si128(x[c]))))
LOOP(int8_avx512vnni, "avx512f,avx512vnni", __m512i, _mm512_set1_epi32(c),
     _mm512_dpbusd_epi32(x[c], _mm512_set1_epi8(2), _mm512_set1_epi8(3)), 64,
     static_cast<float>(_mm_cvtsi128_si32(_mm512_castsi512_si128(x[c]))))

// ---- float --------------------------------------------------------------------------------------

LOOP(float_sse41, "sse4.1", __m128, _mm_set1_ps(static_cast<float>(c)),
     _mm_add_ps(_mm_mul_ps(x[c], _mm_set1_ps(0.5f)), _mm_set1_ps(1)), 4, _mm_cvtss_f32(x[c]))
LOOP(float_avx2, "avx2,fma", __m256, _mm256_set1_ps(static_cast<float>(c)),
     _mm256_fmadd_ps(x[c], _mm256_set1_ps(0.5f), _mm256_set1_ps(1)), 8,
     _mm_cvtss_f32(_mm256_castps256_ps128(x[c])))
LOOP(float_avx512, "avx512f", __m512, _mm512_set1_ps(static_cast<float>(c)),
     _mm512_fmadd_ps(x[c], _mm512_set1_ps(0.5f), _mm512_set1_ps(1)), 16,
     _mm_cvtss_f32(_mm512_castps512_ps128(x[c])))

LOOP(blend_sse41, "sse4.1", __m128, _mm_set1_ps(static_cast<float>(c)),
     _mm_max_ps(_mm_min_ps(_mm_add_ps(_mm_mul_ps(x[c], _mm_set1_ps(0.5f)), _mm_set1_ps(1)),
                           _mm_set1_ps(9)),
                _mm_set1_ps(0)),
     4 * 4, _mm_cvtss_f32(x[c]))
LOOP(blend_avx2, "avx2", __m256, _mm256_set1_ps(static_cast<float>(c)),
     _mm256_max_ps(_mm256_min_ps(_mm256_add_ps(_mm256_mul_ps(x[c], _mm256_set1_ps(0.5f)),
                                               _mm256_set1_ps(1)),
                                 _mm256_set1_ps(9)),
                   _mm256_set1_ps(0)),
     4 * 8, _mm_cvtss_f32(_mm256_castps256_ps128(x[c])))
LOOP(blend_avx512, "avx512f", __m512, _mm512_set1_ps(static_cast<float>(c)),
     _mm512_max_ps(_mm512_min_ps(_mm512_add_ps(_mm512_mul_ps(x[c], _mm512_set1_ps(0.5f)),
                                               _mm512_set1_ps(1)),
                                 _mm512_set1_ps(9)),
                   _mm512_set1_ps(0)),
     4 * 16, _mm_cvtss_f32(_mm512_castps512_ps128(x[c])))

#undef LOOP

struct Cpu {
  bool sse41 = __builtin_cpu_supports("sse4.1"), avx2 = __builtin_cpu_supports("avx2"),
       fma = __builtin_cpu_supports("fma"), avxvnni = __builtin_cpu_supports("avxvnni"),
       avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw"),
       avx512vnni = __builtin_cpu_supports("avx512vnni");
};

void add(std::vector<Peak>& peaks, bool there, const char* isa, Loop loop) {
  if (there) peaks.push_back({isa, loop});
}

}  // namespace

std::vector<Peak> int8_macs() {
  const Cpu cpu;
  std::vector<Peak> peaks;
  add(peaks, cpu.sse41, "sse41", int8_sse41);
  add(peaks, cpu.avx2, "avx2", int8_avx2);
  add(peaks, cpu.avx512, "avx512", int8_avx512);
  add(peaks, cpu.avx2 && cpu.avxvnni, "avxvnni", int8_avxvnni);
  add(peaks, cpu.avx512 && cpu.avx512vnni, "avx512vnni", int8_avx512vnni);
  return peaks;
}

std::vector<Peak> float_macs() {
  const Cpu cpu;
  std::vector<Peak> peaks;
  add(peaks, cpu.sse41, "sse41", float_sse41);
  add(peaks, cpu.avx2 && cpu.fma, "avx2", float_avx2);
  add(peaks, cpu.avx512, "avx512", float_avx512);
  return peaks;
}

std::vector<Peak> blend_operations() {
  const Cpu cpu;
  std::vector<Peak> peaks;
  add(peaks, cpu.sse41, "baseline", blend_sse41);  // the same instructions in SSE2
  add(peaks, cpu.sse41, "sse41", blend_sse41);
  add(peaks, cpu.avx2, "avx2", blend_avx2);
  add(peaks, cpu.avx512, "avx512", blend_avx512);
  return peaks;
}

}  // namespace figurine::roofline
