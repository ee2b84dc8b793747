#include "ports/host/nearest_names.h"

#include <algorithm>
#include <utility>

namespace figurine::ports {

std::vector<std::string> nearest_names(std::string_view name, std::span<const std::string> names) {
  constexpr size_t kAsked = 3, kLongestCompared = 64;
  name = name.substr(0, kLongestCompared);
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
  // Based on: Damerau, A technique for computer detection and correction of spelling errors, 1964,
  // by rows of the usual table. Letters of another case are the same letters.
  const auto distance = [&](std::string_view other) {
    std::vector<std::vector<size_t>> edits(name.size() + 1,
                                           std::vector<size_t>(other.size() + 1, 0));
    for (size_t i = 0; i <= name.size(); ++i) {
      for (size_t j = 0; j <= other.size(); ++j) {
        if (i == 0 || j == 0) {
          edits[i][j] = i + j;
          continue;
        }
        const bool same = small(name[i - 1]) == small(other[j - 1]);
        size_t best = std::min(
            {edits[i - 1][j] + 1, edits[i][j - 1] + 1, edits[i - 1][j - 1] + (same ? 0 : 1)});
        if (i > 1 && j > 1 && small(name[i - 1]) == small(other[j - 2]) &&
            small(name[i - 2]) == small(other[j - 1]))
          best = std::min(best, edits[i - 2][j - 2] + 1);
        edits[i][j] = best;
      }
    }
    return edits[name.size()][other.size()];
  };
  std::vector<std::pair<size_t, std::string>> near;
  for (const std::string& other : names) {
    const size_t edits = distance(std::string_view(other).substr(0, kLongestCompared));
    if (edits <= std::max<size_t>(2, name.size() / 2)) near.emplace_back(edits, other);
  }
  std::stable_sort(near.begin(), near.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> found;
  for (size_t i = 0; i < std::min(kAsked, near.size()); ++i) found.push_back(near[i].second);
  return found;
}

}  // namespace figurine::ports
