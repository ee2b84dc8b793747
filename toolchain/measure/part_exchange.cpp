#include "toolchain/measure/part_exchange.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "figurine/check.h"
#include "figurine/texel_grid.h"

namespace figurine::measure {

namespace {

// Texels sorted by height, so that those within a distance are found among few.
class SortedTexels {
 public:
  explicit SortedTexels(const Body& body) : body_(&body) {}
  void add(uint32_t texel) { texels_.push_back(texel); }
  void sort() {
    std::ranges::sort(texels_, {}, [&](uint32_t texel) { return at(texel)[1]; });
  }
  // Of the nearest one to the texel, at most `most_m`.
  double distance_m(uint32_t from, double most_m) const {
    const float* place = at(from);
    double least = most_m * most_m;
    auto it = std::ranges::lower_bound(texels_, place[1] - most_m, {},
                                       [&](uint32_t texel) { return double(at(texel)[1]); });
    for (; it != texels_.end() && at(*it)[1] <= place[1] + most_m; ++it) {
      double squares = 0;
      for (int k = 0; k < 3; ++k) squares += std::pow(double(at(*it)[k]) - place[k], 2);
      least = std::min(least, squares);
    }
    return std::sqrt(least);
  }

 private:
  const float* at(uint32_t texel) const { return &body_->texel_position_m[size_t{3} * texel]; }

  const Body* body_;
  std::vector<uint32_t> texels_;
};

}  // namespace

std::string part_mixture_obstacle(const Population& population, const Body& body) {
  if (population.static_part.empty())
    return "population '" + population.name +
           "': its members have no static values, there is nothing to take a part of";
  const std::vector<BodyPart> of_texel = texel_parts(body);
  for (const auto& [part, joints] : {std::pair{BodyPart::kHead, "head, neck or jaw"},
                                     {BodyPart::kUpperBody, "spine1, left_collar or left_shoulder"},
                                     {BodyPart::kLowerBody, "pelvis, left_hip or left_knee"}}) {
    if (std::ranges::find(of_texel, part) == of_texel.end())
      return "body '" + body.name + "': has no texel that a joint called like " + joints +
             " moves most";
  }
  return {};
}

PartExchange::PartExchange(const Population& population, const Body& body) {
  const std::vector<BodyPart> of_texel = texel_parts(body);
  for (const StaticGroup& group : population.static_part.groups)
    channels_.push_back(group.channels);
  for (const BodyPart part : kExchangedParts) {
    SortedTexels inside(body), outside(body);
    for (uint32_t i = 0; i < body.texel_count(); ++i)
      (of_texel[i] == part ? inside : outside).add(i);
    inside.sort();
    outside.sort();
    texels_[static_cast<size_t>(part)] = static_cast<size_t>(std::ranges::count(of_texel, part));
    for (const StaticGroup& group : population.static_part.groups) {
      const TexelGrid grid = make_texel_grid(body, group.grid_size);
      const double step = double(body.uv_size) / group.grid_size;
      std::vector<double>& shares = shares_[static_cast<size_t>(part)].emplace_back();
      for (const uint32_t texel : grid.source) {
        const double seam_m = kSeamTexels * step * body.texel_spacing_m[texel];
        const bool is_inside = of_texel[texel] == part;
        const double away = 0.5 * (is_inside ? outside : inside).distance_m(texel, seam_m) / seam_m;
        shares.push_back(is_inside ? 0.5 + away : 0.5 - away);
      }
    }
  }
}

RowVector PartExchange::value_shares(BodyPart part, const WeightLayout& layout) const {
  FIG_CHECK(layout.patches().size() == channels_.size(), "the layout of these maps");
  RowVector shares = RowVector::Zero(static_cast<Eigen::Index>(layout.size()));
  auto at = static_cast<Eigen::Index>(layout.network_size());
  for (size_t g = 0; g < channels_.size(); ++g) {
    for (const uint32_t cell : layout.patches()[g].row) {
      shares.segment(at, channels_[g]).setConstant(share(part, g)[cell]);
      at += channels_[g];
    }
  }
  FIG_CHECK(at == shares.size(), "as many values as the layout has");
  return shares;
}

}  // namespace figurine::measure
