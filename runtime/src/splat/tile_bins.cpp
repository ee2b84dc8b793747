#include "runtime/src/splat/tile_bins.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace figurine {
namespace {

constexpr uint32_t kTile = static_cast<uint32_t>(kernels::kTileSize);
// A Gaussian of a person touches 1 to 4 tiles at usual sizes. The list holds at least one pair per
// Gaussian, so every single tile fits.
constexpr size_t kPairsPerSplat = 4, kMinPairs = 65536;
constexpr uint32_t kSplatsPerSection = 8192;  // fewer are not worth a thread's waking

// Columns of tiles that the splat's ellipse may touch in a row of tiles, ends included.
struct Columns {
  uint32_t first, last;
};

// Exact per row: the ellipse is widest within the row at its widest point clamped to the row,
// because its extent is concave in y. Anything not comparable falls back to the box.
Columns columns_of_row(const kernels::Splat& splat, uint32_t y) {
  // Of rounding: of pixels, of half a width, of a row's place, which the slope multiplies, of sums
  // of far places; and of what is left of the reach at the end of a needle, where it cancels.
  constexpr float kSlackPx = 0.01f, kSlackRatio = 1.0001f, kSlackRows = 8e-6f, kSlackFar = 3e-7f,
                  kReachRatio = 1.000001f;
  const float slack_px =
      kSlackPx + kSlackRows * std::fabs(splat.slope) + kSlackFar * std::fabs(splat.mean_x);
  const float top = (static_cast<float>(y * kTile) + 0.5f) - splat.mean_y,
              bottom = top + static_cast<float>(kTile - 1);
  const auto half_width = [&](float dy) {
    const float v = dy * splat.scale_v, room = kReachRatio * splat.reach - v * v;
    return room > 0 ? std::sqrt(room) * splat.inverse_scale_u * kSlackRatio + slack_px : slack_px;
  };
  const float dy_right = std::min(std::max(splat.widest_dy_px, top), bottom),
              dy_left = std::min(std::max(-splat.widest_dy_px, top), bottom);
  const float right = splat.mean_x + splat.slope * dy_right + half_width(dy_right);
  const float left = splat.mean_x + splat.slope * dy_left - half_width(dy_left);
  Columns columns{splat.tile_x_begin, splat.tile_x_last};
  const uint32_t first = columns.first, last = columns.last;
  if (left >= static_cast<float>((first + 1) * kTile)) {
    columns.first =
        left < static_cast<float>(last * kTile) ? static_cast<uint32_t>(left) / kTile : last;
  }
  if (right < static_cast<float>(last * kTile)) {
    columns.last = right > static_cast<float>(columns.first * kTile)
                       ? static_cast<uint32_t>(right) / kTile
                       : columns.first;
  }
  return columns;
}

}  // namespace

bool TileBins::prepare(uint32_t width_px, uint32_t height_px, size_t splats) {
  tiles_x_ = (width_px + kTile - 1) / kTile;
  tiles_y_ = (height_px + kTile - 1) / kTile;
  capacity_ = std::max(kMinPairs, kPairsPerSplat * splats);
  const size_t sections = pool_.threads();
  return pairs_.ensure(capacity_) && count_.ensure(tiles()) && begin_.ensure(tiles()) &&
         section_count_.ensure(sections * tiles()) && found_.ensure(capacity_) &&
         section_.ensure(sections);
}

uint32_t TileBins::first_of_section(uint32_t section) const {
  return static_cast<uint32_t>(uint64_t{sorted_count_} * section / sections_);
}

// visit(tile) for every tile that the splat counts for.
template <class Visit>
void TileBins::for_each_tile(const kernels::Splat& splat, const Visit& visit) const {
  const bool one_column = splat.tile_x_begin == splat.tile_x_last;
  for (uint32_t y = splat.tile_y_begin; y <= splat.tile_y_last; ++y) {
    const Columns columns = one_column || !exact_ ? Columns{splat.tile_x_begin, splat.tile_x_last}
                                                  : columns_of_row(splat, y);
    for (uint32_t x = columns.first; x <= columns.last; ++x) visit(y * tiles_x_ + x);
  }
}

void TileBins::count_section(uint32_t section) {
  uint32_t* counts = section_count_.data() + size_t{section} * tiles();
  std::memset(counts, 0, tiles() * sizeof(uint32_t));
  Pair* const found = found_in(section);
  const uint64_t limit = found_limit();
  uint64_t boxes = 0, pairs = 0;
  for (uint32_t i = first_of_section(section); i < first_of_section(section + 1); ++i) {
    const uint32_t slot = sorted_[i].index;
    const kernels::Splat& splat = splats_[slot];
    boxes += uint64_t(splat.tile_x_last - splat.tile_x_begin + 1) *
             uint64_t(splat.tile_y_last - splat.tile_y_begin + 1);
    for_each_tile(splat, [&](uint32_t tile) {
      ++counts[tile];
      if (pairs < limit) found[pairs] = {slot, tile};
      ++pairs;
    });
  }
  section_[section] = {.pairs = pairs, .missed = boxes - pairs};
}

void TileBins::count(const kernels::Splat* splats, const DepthSort::Item* sorted,
                     uint32_t sorted_count, bool exact) {
  splats_ = splats;
  sorted_ = sorted;
  sorted_count_ = sorted_count;
  exact_ = exact;
  sections_ = std::clamp(sorted_count / kSplatsPerSection, 1u, pool_.threads());
  pool_.for_each(sections_, [&](size_t section) { count_section(static_cast<uint32_t>(section)); });
  pair_count_ = missed_ = 0;
  for (uint32_t section = 0; section < sections_; ++section) missed_ += section_[section].missed;
  for (uint32_t tile = 0; tile < tiles(); ++tile) {
    count_[tile] = 0;
    for (uint32_t section = 0; section < sections_; ++section) {
      count_[tile] += section_count_[size_t{section} * tiles() + tile];
    }
    pair_count_ += count_[tile];
  }
}

TileBins::Band TileBins::fill_band(uint32_t begin) {
  Band band{begin, begin};
  uint32_t sum = 0;
  for (; band.end < tiles() && sum + count_[band.end] <= capacity_; ++band.end) {
    begin_[band.end] = sum;
    // Counts turn into cursors: where each section's next pair of the tile goes.
    for (uint32_t section = 0; section < sections_; ++section) {
      uint32_t& cursor = section_count_[size_t{section} * tiles() + band.end];
      const uint32_t count = cursor;
      cursor = sum;
      sum += count;
    }
  }
  pool_.for_each(sections_,
                 [&](size_t section) { fill_section(static_cast<uint32_t>(section), band); });
  return band;
}

void TileBins::fill_section(uint32_t section, const Band& band) {
  uint32_t* cursors = section_count_.data() + size_t{section} * tiles();
  const auto add = [&](uint32_t slot, uint32_t tile) {
    if (tile >= band.begin && tile < band.end) pairs_[cursors[tile]++] = slot;
  };
  if (const uint64_t pairs = section_[section].pairs; pairs <= found_limit()) {
    const Pair* const found = found_in(section);
    for (uint64_t i = 0; i < pairs; ++i) add(found[i].slot, found[i].tile);
    return;
  }
  for (uint32_t i = first_of_section(section); i < first_of_section(section + 1); ++i) {
    const uint32_t slot = sorted_[i].index;
    for_each_tile(splats_[slot], [&](uint32_t tile) { add(slot, tile); });
  }
}

uint64_t TileBins::memory_bytes() const {
  return pairs_.memory_bytes() + count_.memory_bytes() + begin_.memory_bytes() +
         section_count_.memory_bytes() + found_.memory_bytes() + section_.memory_bytes();
}

}  // namespace figurine
