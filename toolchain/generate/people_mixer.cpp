#include "toolchain/generate/people_mixer.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"
#include "figurine/texel_grid.h"
#include "toolchain/error.h"
#include "toolchain/measure/body_parts.h"
#include "toolchain/measure/part_exchange.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/random/counter.h"

namespace figurine::generate {

using measure::BodyPart;
using measure::RowMatrix;
using measure::WeightLayout;

namespace {

// Streams of random numbers, beside those of the trainer.
constexpr uint64_t kUpper = 101, kLower = 102;

// The mean of the hands' static colours of every member; no columns where there are none. [N,C]
RowMatrix hand_colours(const RowMatrix& training, const WeightLayout& layout,
                       const Population& population, const Body& body) {
  const std::vector<BodyPart> of_texel = measure::texel_parts(body);
  RowMatrix colours(training.rows(), 0);
  auto at = static_cast<Eigen::Index>(layout.network_size());
  for (size_t g = 0; g < population.static_part.groups.size(); ++g) {
    const StaticGroup& group = population.static_part.groups[g];
    const TexelGrid grid = make_texel_grid(body, group.grid_size);
    const Eigen::Index skipped =
        std::max<Eigen::Index>(0, Eigen::Index{kStaticColour} - group.first_channel);
    const Eigen::Index own = std::max<Eigen::Index>(0, group.channels - skipped);
    RowMatrix sum = RowMatrix::Zero(training.rows(), own);
    size_t cells = 0;
    for (const uint32_t cell : layout.patches()[g].row) {
      if (own > 0 && of_texel[grid.source[cell]] == BodyPart::kHands)
        sum += training.middleCols(at + skipped, own), ++cells;
      at += group.channels;
    }
    if (own == 0 || cells == 0) continue;
    colours.conservativeResize(Eigen::NoChange, colours.cols() + own);
    colours.rightCols(own) = sum / static_cast<double>(cells);
  }
  return colours;
}

RowMatrix shapes_of(const RowMatrix& training, const WeightLayout& layout) {
  for (const measure::Token& token : layout.tokens()) {
    if (token.name == "shape")
      return training.middleCols(static_cast<Eigen::Index>(token.begin),
                                 static_cast<Eigen::Index>(token.size));
  }
  return RowMatrix(training.rows(), 0);
}

// Distances of all pairs over their median; nothing where all are alike. [N,N]
RowMatrix relative_distances(const RowMatrix& rows) {
  RowMatrix distances = RowMatrix::Zero(rows.rows(), rows.rows());
  std::vector<double> pairs;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      distances(i, j) = distances(j, i) = (rows.row(i) - rows.row(j)).norm();
      pairs.push_back(distances(i, j));
    }
  }
  const double median = measure::quantile(pairs, 0.5);
  if (median > 0) distances /= median;
  return distances;
}

}  // namespace

PeopleMixer::PeopleMixer(const RowMatrix& training, const WeightLayout& layout,
                         const Population& population, const Body& body) {
  FIG_CHECK(training.rows() >= 2 && size_t(training.cols()) == layout.size(),
            "at least two members of this layout");
  if (const std::string obstacle = measure::part_mixture_obstacle(population, body);
      !obstacle.empty())
    throw InputError(obstacle);
  for (const measure::Token& token : layout.tokens()) {
    from_.push_back(token.part == BodyPart::kUpperBody   ? From::kUpper
                    : token.part == BodyPart::kLowerBody ? From::kLower
                                                         : From::kBase);
  }
  find_alike(hand_colours(training, layout, population, body), shapes_of(training, layout));
}

void PeopleMixer::find_alike(const RowMatrix& colours, const RowMatrix& shapes) {
  const RowMatrix distances = relative_distances(colours) + relative_distances(shapes);
  const auto members = static_cast<size_t>(distances.rows());
  const size_t others = members - 1;
  const size_t kept =
      std::clamp(static_cast<size_t>(std::lround(kAlikeShare * static_cast<double>(members))),
                 std::min<size_t>(2, others), others);
  for (size_t m = 0; m < members; ++m) {
    std::vector<size_t>& alike = alike_.emplace_back();
    for (size_t other = 0; other < members; ++other) {
      if (other != m) alike.push_back(other);
    }
    std::ranges::stable_sort(
        alike, {}, [&](size_t other) { return distances(Eigen::Index(m), Eigen::Index(other)); });
    alike.resize(kept);
  }
}

MixedPerson PeopleMixer::draw(uint64_t seed, uint64_t counter, size_t base) const {
  const std::vector<size_t>& others = alike_[base];
  const auto pick = [&](uint64_t stream, size_t among) {
    return static_cast<size_t>(random::random_bits(seed, stream, counter) % among);
  };
  const size_t upper = pick(kUpper, others.size());
  if (others.size() == 1) return {base, others[upper], others[upper]};
  const size_t lower = pick(kLower, others.size() - 1);  // of those that are not `upper`
  return {base, others[upper], others[lower + (lower >= upper ? 1 : 0)]};
}

size_t PeopleMixer::donor(const MixedPerson& person, size_t token) const {
  switch (from_[token]) {
    case From::kUpper:
      return person.upper;
    case From::kLower:
      return person.lower;
    default:
      return person.base;
  }
}

}  // namespace figurine::generate
