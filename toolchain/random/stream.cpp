#include "toolchain/random/stream.h"

#include <algorithm>

#include "figurine/check.h"
#include "figurine/detail/philox.h"

namespace figurine::random {

size_t RandomStream::index(uint64_t counter, size_t count) const {
  FIG_CHECK(count >= 1 && uint64_t{count} <= 0xffffffff, "a count of one to 2^32 - 1");
  const std::array<uint32_t, 4> words = stream_words(seed_, stream_, counter / 2);
  const uint64_t high = words[2 * (counter % 2)], low = words[2 * (counter % 2) + 1];
  return static_cast<size_t>((high * count + (low * count >> 32)) >> 32);
}

std::vector<size_t> RandomStream::distinct(size_t m, size_t count) const {
  FIG_CHECK(m <= count, "no more than there are");
  std::vector<size_t> chosen;
  for (size_t i = 0; i < m; ++i) {
    const size_t last = count - m + i, drawn = index(i, last + 1);
    const bool taken = std::find(chosen.begin(), chosen.end(), drawn) != chosen.end();
    chosen.push_back(taken ? last : drawn);
  }
  return chosen;
}

void RandomStream::fill_normal(std::span<double> values) const {
  for (size_t i = 0; i < values.size(); i += 4) {
    const std::array<double, 4> normal = stream_normals(seed_, stream_, i / 4);
    std::copy_n(normal.begin(), std::min<size_t>(4, values.size() - i),
                values.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace figurine::random
