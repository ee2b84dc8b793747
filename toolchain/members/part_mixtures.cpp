#include "toolchain/members/part_mixtures.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "figurine/check.h"
#include "figurine/texel_grid.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::BodyPart;
using measure::PartExchange;
using measure::RowVector;
using measure::WeightLayout;
using measure::WeightStorage;
using train::OpenedMember;

namespace {

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
  return measure::kExchangedParts[static_cast<size_t>(row) - static_cast<size_t>(PartRow::kHead)];
}

}  // namespace

Avatar part_row(const WeightLayout& layout, const PartExchange& parts, const Avatar& a,
                const Avatar& b, PartRow row, WeightStorage& storage) {
  if (row == PartRow::kA) return a;
  if (row == PartRow::kB) return b;
  const auto size = static_cast<Eigen::Index>(layout.size());
  RowVector mixed(size), donor(size);
  layout.read(a, {mixed.data(), layout.size()});
  layout.read(b, {donor.data(), layout.size()});
  mixed.array() += parts.value_shares(part_of(row), layout).array() * (donor - mixed).array();
  return layout.with(a, {mixed.data(), layout.size()}, storage);
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
