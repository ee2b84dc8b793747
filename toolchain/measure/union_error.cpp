#include "toolchain/measure/union_error.h"

#include <algorithm>
#include <utility>

#include "figurine/check.h"
#include "toolchain/measure/widest_vectors.h"

namespace figurine::measure {

namespace {

// Over mid-grey, in half levels: 510 is white.
int16_t half_levels(const Picture& picture, size_t pixel, int channel) {
  const uint8_t* p = &picture.rgba[4 * pixel];
  return static_cast<int16_t>(2 * p[channel] + 255 - p[3]);
}

constexpr double kHalfLevels2 = 510.0 * 510.0;

}  // namespace

SquaredError union_error(const Picture& a, const Picture& b) {
  FIG_CHECK(a.rgba.size() == b.rgba.size(), "pictures of one size");
  SquaredError error;
  int64_t sum = 0;
  for (size_t pixel = 0; pixel < a.rgba.size() / 4; ++pixel) {
    if (!is_foreground(a, pixel) && !is_foreground(b, pixel)) continue;
    for (int c = 0; c < 3; ++c) {
      const int64_t difference = half_levels(a, pixel, c) - half_levels(b, pixel, c);
      sum += difference * difference;
    }
    error.count += 3;
  }
  error.sum = static_cast<double>(sum) / kHalfLevels2;
  return error;
}

SquaredError union_error(std::span<const Picture> a, std::span<const Picture> b) {
  SquaredError error;
  for (size_t i = 0; i < a.size(); ++i) error.add(union_error(a[i], b[i]));
  return error;
}

namespace {

constexpr size_t kRun = 4096;  // as many squares of at most 510^2 stay within 32 bits

FIG_WIDEST_VECTORS uint32_t count_union(const int16_t* mask_a, const int16_t* mask_b,
                                        size_t count) {
  int32_t seen = 0;
  for (size_t i = 0; i < count; ++i) seen -= mask_a[i] | mask_b[i];
  return static_cast<uint32_t>(seen);
}

FIG_WIDEST_VECTORS uint32_t masked_squares(const int16_t* a, const int16_t* b,
                                           const int16_t* mask_a, const int16_t* mask_b,
                                           size_t count) {
  int32_t squares = 0;
  for (size_t i = 0; i < count; ++i) {
    const auto difference = static_cast<int16_t>((a[i] - b[i]) & (mask_a[i] | mask_b[i]));
    squares += int32_t(difference) * difference;
  }
  return static_cast<uint32_t>(squares);
}

}  // namespace

ComparedPictures::ComparedPictures(std::span<const std::vector<Picture>> members) {
  std::vector<std::pair<size_t, size_t>> kept;  // picture, pixel
  const size_t pictures = members.empty() ? 0 : members[0].size();
  for (size_t view = 0; view < pictures; ++view) {
    for (size_t pixel = 0; pixel < members[0][view].rgba.size() / 4; ++pixel) {
      const bool seen = std::any_of(members.begin(), members.end(), [&](const auto& own) {
        return is_foreground(own[view], pixel);
      });
      if (seen) kept.emplace_back(view, pixel);
    }
  }
  pixels_ = kept.size();
  values_.resize(members.size() * 3 * pixels_);
  foreground_.resize(members.size() * pixels_);
  for (size_t m = 0; m < members.size(); ++m) {
    for (size_t i = 0; i < pixels_; ++i) {
      const auto [view, pixel] = kept[i];
      for (int c = 0; c < 3; ++c)
        values_[(3 * m + c) * pixels_ + i] = half_levels(members[m][view], pixel, c);
      foreground_[m * pixels_ + i] = is_foreground(members[m][view], pixel) ? -1 : 0;
    }
  }
}

SquaredError ComparedPictures::error(size_t a, size_t b) const {
  uint64_t sum = 0, pixels = 0;
  for (size_t begin = 0; begin < pixels_; begin += kRun) {
    const size_t count = std::min(kRun, pixels_ - begin);
    const int16_t *mask_a = &foreground_[a * pixels_ + begin],
                  *mask_b = &foreground_[b * pixels_ + begin];
    pixels += count_union(mask_a, mask_b, count);
    for (size_t c = 0; c < 3; ++c) {
      sum += masked_squares(&values_[(3 * a + c) * pixels_ + begin],
                            &values_[(3 * b + c) * pixels_ + begin], mask_a, mask_b, count);
    }
  }
  return {static_cast<double>(sum) / kHalfLevels2, 3 * pixels};
}

}  // namespace figurine::measure
