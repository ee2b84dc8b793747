// Dot products of int16 arrays to exact int32 sums by vpmaddwd, eight rows at a time: as many sums
// as one register holds, so that adding up within registers (vphaddd) is shared by eight.
#include <immintrin.h>

#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

constexpr uint64_t kValues = 16;  // int16 in a register

__m256i load(const int16_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
__m128i load_half(const int16_t* from) {
  return _mm_load_si128(reinterpret_cast<const __m128i*>(from));
}

void add_eight(const int16_t* shared, const int16_t* rows, uint64_t length, int32_t* sums) {
  __m256i s[8];
  for (int i = 0; i < 8; ++i) s[i] = _mm256_setzero_si256();
  uint64_t k = 0;
  for (; k + kValues <= length; k += kValues) {
    const __m256i a = load(shared + k);
    for (uint64_t i = 0; i < 8; ++i)
      s[i] = _mm256_add_epi32(s[i], _mm256_madd_epi16(a, load(rows + i * length + k)));
  }
  if (k < length) {  // half a register
    const __m256i a = _mm256_zextsi128_si256(load_half(shared + k));
    for (uint64_t i = 0; i < 8; ++i) {
      const __m256i row = _mm256_zextsi128_si256(load_half(rows + i * length + k));
      s[i] = _mm256_add_epi32(s[i], _mm256_madd_epi16(a, row));
    }
  }
  const __m256i first =
                    _mm256_hadd_epi32(_mm256_hadd_epi32(s[0], s[1]), _mm256_hadd_epi32(s[2], s[3])),
                last =
                    _mm256_hadd_epi32(_mm256_hadd_epi32(s[4], s[5]), _mm256_hadd_epi32(s[6], s[7]));
  const __m256i added = _mm256_add_epi32(_mm256_permute2x128_si256(first, last, 0x20),
                                         _mm256_permute2x128_si256(first, last, 0x31));
  __m256i* to = reinterpret_cast<__m256i*>(sums);
  _mm256_storeu_si256(to, _mm256_add_epi32(_mm256_loadu_si256(to), added));
}

void add_four(const int16_t* shared, const int16_t* rows, uint64_t length, int32_t* sums) {
  __m128i s[4];
  for (int i = 0; i < 4; ++i) s[i] = _mm_setzero_si128();
  for (uint64_t k = 0; k < length; k += kDotMultiple) {
    const __m128i a = load_half(shared + k);
    for (uint64_t i = 0; i < 4; ++i)
      s[i] = _mm_add_epi32(s[i], _mm_madd_epi16(a, load_half(rows + i * length + k)));
  }
  const __m128i added = _mm_hadd_epi32(_mm_hadd_epi32(s[0], s[1]), _mm_hadd_epi32(s[2], s[3]));
  __m128i* to = reinterpret_cast<__m128i*>(sums);
  _mm_storeu_si128(to, _mm_add_epi32(_mm_loadu_si128(to), added));
}

}  // namespace

void add_dots_avx2(const AddDotsJob& job) {
  static_assert(kDotsAtOnce == 4 && kDotMultiple == 8);
  uint64_t i = 0;
  for (; i + 8 <= job.count; i += 8)
    add_eight(job.shared, job.rows + i * job.length, job.length, job.sums + i);
  if (i < job.count) add_four(job.shared, job.rows + i * job.length, job.length, job.sums + i);
}

}  // namespace figurine::kernels
