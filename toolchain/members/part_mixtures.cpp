#include "toolchain/members/part_mixtures.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "figurine/check.h"
#include "figurine/texel_grid.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::WeightLayout;
using measure::WeightStorage;
using pictures::BodyPart;
using train::OpenedMember;

namespace {

constexpr std::array kExchanged{BodyPart::kHead, BodyPart::kUpperBody, BodyPart::kLowerBody};

const char* to_string(PartRow row) {
  switch (row) {
    case PartRow::kA:
      return "a";
    case PartRow::kB:
      return "b";
    case PartRow::kHead:
      return "head";
    case PartRow::kUpperBody:
      return "upper_body";
    default:
      return "lower_body";
  }
}

BodyPart part_of(PartRow row) {
  FIG_CHECK(row >= PartRow::kHead, "a row that takes a part");
  return kExchanged[static_cast<size_t>(row) - static_cast<size_t>(PartRow::kHead)];
}

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
  const std::vector<BodyPart> of_texel = pictures::texel_parts(body);
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
  const std::vector<BodyPart> of_texel = pictures::texel_parts(body);
  for (const BodyPart part : kExchanged) {
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

Avatar part_row(const WeightLayout& layout, const PartExchange& parts, const Avatar& a,
                const Avatar& b, PartRow row, WeightStorage& storage) {
  if (row == PartRow::kA) return a;
  if (row == PartRow::kB) return b;
  std::vector<double> mixed(layout.size()), donor(layout.size());
  layout.read(a, mixed);
  layout.read(b, donor);
  size_t at = layout.network_size();
  for (size_t g = 0; g < layout.patches().size(); ++g) {
    const uint32_t channels = a.static_part.groups[g].channels;
    const std::vector<double>& shares = parts.share(part_of(row), g);
    for (const uint32_t cell : layout.patches()[g].row) {
      for (uint32_t c = 0; c < channels; ++c, ++at)
        mixed[at] += shares[cell] * (donor[at] - mixed[at]);
    }
  }
  return layout.with(a, mixed, storage);
}

nlohmann::json measure_part_mixtures(const MemberSet& set, const PartExchange& parts,
                                     const std::vector<MixedPair>& pairs) {
  std::vector<Mixture> mixtures(pairs.size() * kPartRows.size());
  set.crew.run("mixing parts", mixtures.size(), [&](size_t i) {
    const MixedPair& pair = pairs[i / kPartRows.size()];
    const OpenedMember a(set.population(), pair.a), b(set.population(), pair.b);
    WeightStorage storage;
    mixtures[i] = measure_mixture(set, part_row(set.layout, parts, a.avatar, b.avatar,
                                                kPartRows[i % kPartRows.size()], storage));
  });
  nlohmann::json report{{"seam_texels", PartExchange::kSeamTexels},
                        {"texels",
                         {{"head", parts.texels(BodyPart::kHead)},
                          {"upper_body", parts.texels(BodyPart::kUpperBody)},
                          {"lower_body", parts.texels(BodyPart::kLowerBody)}}},
                        {"pairs", nlohmann::json::array()}};
  for (size_t p = 0; p < pairs.size(); ++p) {
    const Mixture* own = &mixtures[p * kPartRows.size()];
    nlohmann::json pair{
        {"a", set.name(pairs[p].a)}, {"b", set.name(pairs[p].b)}, {"why", pairs[p].why}};
    for (size_t i = 0; i < kPartRows.size(); ++i) {
      nlohmann::json row{{"of", to_string(kPartRows[i])}};
      row.update(own[i].describe(own[0], own[1]));
      pair["rows"].push_back(std::move(row));
    }
    report["pairs"].push_back(std::move(pair));
  }
  return report;
}

}  // namespace figurine::members
