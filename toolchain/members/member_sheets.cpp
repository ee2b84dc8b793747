#include "toolchain/members/member_sheets.h"

#include <algorithm>
#include <cmath>

#include "ports/media/jpeg.h"
#include "toolchain/error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::Picture;
using measure::RowMatrix;
using measure::RowVector;
using measure::WeightStorage;
using train::OpenedMember;

namespace {

constexpr uint8_t kGrey = 128, kLine = 176;
constexpr uint32_t kSeparator_px = 11;  // between rows of different parts; its line is one pixel
constexpr uint32_t kMaxWall_px = 16000;

ports::ImageU8 grey_image(uint32_t width, uint32_t height) {
  ports::ImageU8 image(width, height, 3);
  std::fill(image.pixels.begin(), image.pixels.end(), kGrey);
  return image;
}

void paste(const Picture& picture, ports::ImageU8& sheet, uint32_t left, uint32_t top) {
  for (uint32_t y = 0; y < picture.height_px; ++y) {
    for (uint32_t x = 0; x < picture.width_px; ++x) {
      const uint8_t* p = &picture.rgba[(size_t(y) * picture.width_px + x) * 4];
      uint8_t* out = sheet.at(left + x, top + y);
      for (int c = 0; c < 3; ++c)
        out[c] = static_cast<uint8_t>(std::min(255, p[c] + ((255 - p[3]) * kGrey + 127) / 255));
    }
  }
}

struct Line {
  uint32_t left, top, width, height;
};
void draw_line(ports::ImageU8& sheet, const Line& line) {
  for (uint32_t y = line.top; y < line.top + line.height; ++y) {
    for (uint32_t x = line.left; x < line.left + line.width; ++x)
      std::fill_n(sheet.at(x, y), 3, kLine);
  }
}

// Members by split and name: [parts that are not empty][members].
std::vector<std::vector<size_t>> parts_of(const Population& population) {
  std::vector<std::vector<size_t>> parts(3);
  for (size_t m = 0; m < population.size(); ++m)
    parts[size_t(population.members[m].split)].push_back(m);
  std::erase_if(parts, [](const auto& part) { return part.empty(); });
  for (auto& part : parts) {
    std::sort(part.begin(), part.end(), [&](size_t a, size_t b) {
      return population.members[a].name < population.members[b].name;
    });
  }
  return parts;
}

// Cell heights. Small networks were trained on small pictures: drawn much larger, their Gaussians
// leave gaps.
struct Heights {
  uint32_t wall_px, bust_px, mixture_px, close_px;
};
Heights heights_for(const Population& population) {
  return population.texels_a_side() >= 64 ? Heights{256, 176, 360, 420}
                                          : Heights{144, 96, 176, 208};
}

// At most so high that everybody fits into a picture that people still open.
uint32_t wall_height_px(const MemberSet& set, size_t shot, uint32_t wanted_px) {
  constexpr double kWall_px2 = 16e6;
  const double members = static_cast<double>(set.population().size()),
               aspect = double(set.portrait_width_px(shot, wanted_px)) / wanted_px;
  return std::min(wanted_px, static_cast<uint32_t>(std::sqrt(kWall_px2 / (members * aspect))));
}

uint32_t rows_for(size_t members, uint32_t columns) {
  return uint32_t((members + columns - 1) / columns);
}

// Where a part begins, in cells. Parts of less than a row share one with their neighbour where they
// fit.
struct Place {
  uint32_t row = 0, column = 0;
};
struct Layout {
  std::vector<Place> places;  // [parts]
  uint32_t rows = 0;
};
Layout lay_out(const std::vector<std::vector<size_t>>& parts, uint32_t columns) {
  Layout layout;
  uint32_t filled = columns;  // cells of the last row that hold a part of one row alone
  for (const auto& part : parts) {
    const auto size = static_cast<uint32_t>(part.size());
    if (filled + size <= columns) {
      layout.places.push_back({layout.rows - 1, filled});
      filled += size;
      continue;
    }
    layout.places.push_back({layout.rows, 0});
    layout.rows += rows_for(size, columns);
    filled = size < columns ? size : columns;
  }
  return layout;
}

// Columns that leave few cells empty and make the wall somewhat wider than high.
uint32_t choose_columns(const std::vector<std::vector<size_t>>& parts, float cell_aspect) {
  uint32_t best = 1;
  double best_cost = 1e30;
  size_t members = 0, largest = 0;
  for (const auto& part : parts) members += part.size(), largest = std::max(largest, part.size());
  for (uint32_t columns = 1; columns <= largest; ++columns) {
    const uint32_t rows = lay_out(parts, columns).rows;
    const double shape = std::log(double(columns) * cell_aspect / (1.4 * rows));
    const double empty = double(columns) * rows / double(members) - 1;
    const double cost = shape * shape + empty;
    if (cost < best_cost) best_cost = cost, best = columns;
  }
  return best;
}

// Cells of one size side by side: [rows][columns], all rows of one length.
ports::ImageU8 tile(const std::vector<std::vector<Picture>>& rows) {
  const Picture& cell = rows[0][0];
  ports::ImageU8 sheet =
      grey_image(cell.width_px * uint32_t(rows[0].size()), cell.height_px * uint32_t(rows.size()));
  for (size_t r = 0; r < rows.size(); ++r) {
    for (size_t c = 0; c < rows[r].size(); ++c)
      paste(rows[r][c], sheet, uint32_t(c) * cell.width_px, uint32_t(r) * cell.height_px);
  }
  return sheet;
}

ports::ImageU8 draw_everybody(const MemberSet& set, const std::string& what, size_t shot,
                              uint32_t height) {
  const Population& population = set.population();
  std::vector<Picture> portraits(population.size());
  set.crew.run(what, population.size(), [&](size_t m) {
    portraits[m] = set.portrait(OpenedMember(population, m).avatar, shot, height);
  });
  const uint32_t width = portraits[0].width_px;
  const std::vector<std::vector<size_t>> parts = parts_of(population);
  const uint32_t columns =
      std::min(choose_columns(parts, float(width) / float(height)), kMaxWall_px / width);
  const Layout layout = lay_out(parts, columns);
  uint32_t separators = 0;
  for (size_t i = 1; i < parts.size(); ++i) separators += layout.places[i].column == 0;
  ports::ImageU8 wall =
      grey_image(columns * width, layout.rows * height + separators * kSeparator_px);
  uint32_t above = 0;  // separators so far
  for (size_t i = 0; i < parts.size(); ++i) {
    const Place& place = layout.places[i];
    if (i > 0 && place.column == 0)
      draw_line(wall, {0, place.row * height + kSeparator_px * above++ + kSeparator_px / 2,
                       wall.width_px, 1});
    const uint32_t top = place.row * height + kSeparator_px * above;
    for (uint32_t k = 0; k < parts[i].size(); ++k) {
      const uint32_t cell = place.column + k;
      paste(portraits[parts[i][k]], wall, cell % columns * width, top + cell / columns * height);
    }
    if (place.column > 0) draw_line(wall, {place.column * width, top, 1, height});
  }
  return wall;
}

}  // namespace

ports::ImageU8 draw_wall(const MemberSet& set) {
  return draw_everybody(set, "wall", kFrontPortrait,
                        wall_height_px(set, kFrontPortrait, heights_for(set.population()).wall_px));
}

ports::ImageU8 draw_bust_wall(const MemberSet& set) {
  return draw_everybody(set, "wall of busts", kBustPortrait,
                        wall_height_px(set, kBustPortrait, heights_for(set.population()).bust_px));
}

ports::ImageU8 draw_mixtures(const MemberSet& set, const std::vector<MixedPair>& pairs) {
  constexpr size_t kSteps = std::size(kMixSteps);
  const uint32_t height = heights_for(set.population()).mixture_px;
  std::vector<std::vector<Picture>> rows(pairs.size(), std::vector<Picture>(kSteps));
  set.crew.run("strip", pairs.size() * kSteps, [&](size_t i) {
    const MixedPair& pair = pairs[i / kSteps];
    const OpenedMember a(set.population(), pair.a), b(set.population(), pair.b);
    WeightStorage storage;
    rows[i / kSteps][i % kSteps] =
        set.portrait(mix(set.layout, a.avatar, b.avatar, kMixSteps[i % kSteps], storage),
                     kFrontPortrait, height);
  });
  return tile(rows);
}

ports::ImageU8 draw_part_mixtures(const MemberSet& set, const measure::PartExchange& parts,
                                  const std::vector<MixedPair>& pairs) {
  constexpr size_t kColumns = std::size(kPartRows), kEnds = 2;
  const uint32_t height = heights_for(set.population()).mixture_px;
  std::vector<Picture> cells(pairs.size() * kColumns);
  set.crew.run("parts", cells.size(), [&](size_t i) {
    const MixedPair& pair = pairs[i / kColumns];
    const OpenedMember a(set.population(), pair.a), b(set.population(), pair.b);
    WeightStorage storage;
    cells[i] = set.portrait(
        part_row(set.layout, parts, a.avatar, b.avatar, kPartRows[i % kColumns], storage),
        kFrontPortrait, height);
  });
  const uint32_t width = cells[0].width_px;
  ports::ImageU8 sheet =
      grey_image(kColumns * width + kSeparator_px, height * uint32_t(pairs.size()));
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto column = static_cast<uint32_t>(i % kColumns);
    paste(cells[i], sheet, column * width + (column < kEnds ? 0 : kSeparator_px),
          uint32_t(i / kColumns) * height);
  }
  draw_line(sheet, {uint32_t(kEnds) * width + kSeparator_px / 2, 0, 1, sheet.height_px});
  return sheet;
}

ports::ImageU8 draw_close(const MemberSet& set, const std::vector<size_t>& members) {
  const uint32_t pairs_a_row = uint32_t(std::min<size_t>(5, members.size()));
  std::vector<std::vector<Picture>> rows(rows_for(members.size(), pairs_a_row),
                                         std::vector<Picture>(2 * pairs_a_row));
  set.crew.run("worst", members.size(), [&](size_t i) {
    const OpenedMember member(set.population(), members[i]);
    for (size_t side = 0; side < 2; ++side) {
      rows[i / pairs_a_row][2 * (i % pairs_a_row) + side] =
          set.portrait(member.avatar, side == 0 ? kFrontPortrait : kBackPortrait,
                       heights_for(set.population()).close_px);
    }
  });
  return tile(rows);
}

ports::ImageU8 draw_people(const MemberSet& set, const std::vector<RowMatrix>& sets,
                           size_t people) {
  const OpenedMember like(set.population(), set.training.front());
  std::vector<std::vector<Picture>> rows(sets.size(), std::vector<Picture>(people));
  set.crew.run("sheet", sets.size() * people, [&](size_t i) {
    const RowVector weights =
        set.standardisation.restore(sets[i / people].row(static_cast<Eigen::Index>(i % people)));
    WeightStorage storage;
    rows[i / people][i % people] = set.portrait(
        set.layout.with(like.avatar, {weights.data(), size_t(weights.size())}, storage),
        kFrontPortrait, heights_for(set.population()).wall_px);
  });
  return tile(rows);
}

std::vector<std::byte> encode_sheet(const ports::ImageU8& sheet, size_t max_bytes) {
  std::vector<std::byte> bytes;
  for (int quality = 92; quality >= 60; quality -= 4) {
    bytes = value_or_throw(ports::encode_jpeg(sheet, quality), "a sheet of members");
    if (bytes.size() <= max_bytes) break;
  }
  return bytes;
}

}  // namespace figurine::members
