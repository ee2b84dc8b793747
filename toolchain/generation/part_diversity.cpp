#include "toolchain/generation/part_diversity.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "figurine/check.h"
#include "toolchain/generation/novelty.h"
#include "toolchain/json_number.h"
#include "toolchain/measure/statistics.h"

namespace figurine::generation {

using measure::RowMatrix;
using measure::Token;

namespace {

constexpr double kFaintest = 0.05;  // quantile of members' own distances from their mean

std::string part_of(const Token& token) {
  if (token.name == "shape") return "build";
  return token.part ? to_string(*token.part) : std::string();
}

RowMatrix values_of(const PartStretch& part, const RowMatrix& rows) {
  Eigen::Index size = 0;
  for (const Token& token : part.tokens) size += static_cast<Eigen::Index>(token.size);
  RowMatrix values(rows.rows(), size);
  Eigen::Index at = 0;
  for (const Token& token : part.tokens) {
    const auto own = static_cast<Eigen::Index>(token.size);
    values.middleCols(at, own) = rows.middleCols(static_cast<Eigen::Index>(token.begin), own);
    at += own;
  }
  return values;
}

double spread_of(const RowMatrix& rows) {
  return std::sqrt((rows.rowwise() - rows.colwise().mean()).array().square().mean());
}

}  // namespace

std::vector<PartStretch> parts_of(const std::vector<Token>& tokens) {
  std::vector<PartStretch> parts;
  for (const Token& token : tokens) {
    const std::string name = part_of(token);
    if (name.empty()) continue;
    auto part = std::ranges::find(parts, name, &PartStretch::name);
    if (part == parts.end()) part = parts.insert(part, {name, {}});
    part->tokens.push_back(token);
  }
  return parts;
}

nlohmann::json describe_parts(const std::vector<PartStretch>& parts, const RowMatrix& samples,
                              const RowMatrix& training) {
  if (parts.empty()) return nlohmann::json::object();
  FIG_CHECK(samples.rows() > 0 && training.rows() >= 2, "samples and members");
  const auto count = static_cast<size_t>(samples.rows());
  std::vector<std::vector<size_t>> nearest(count);  // [S] members, part by part
  std::vector<bool> faint(count);
  nlohmann::json rows = nlohmann::json::array();
  for (const PartStretch& part : parts) {
    const RowMatrix own = values_of(part, samples), members = values_of(part, training);
    const auto size = static_cast<size_t>(own.cols());
    const double spread = spread_of(members);
    if (!(spread > 0)) continue;  // nobody differs in it
    const Novelty novelty = measure_novelty(measure::rms_distances(own, members, size),
                                            measure::rms_distances(members, members, size));
    rows.push_back({{"part", part.name},
                    {"median_ratio", finite(novelty.median_ratio)},
                    {"copy_share", novelty.copy_share},
                    {"members_met", novelty.members_met},
                    {"spread", spread_of(own) / spread}});
    const auto mean = members.colwise().mean();
    std::vector<double> away;
    for (Eigen::Index n = 0; n < members.rows(); ++n)
      away.push_back((members.row(n) - mean).norm());
    const double least = measure::quantile(away, kFaintest);
    for (size_t s = 0; s < count; ++s) {
      nearest[s].push_back(novelty.samples[s].member);
      if ((own.row(static_cast<Eigen::Index>(s)) - mean).norm() < least) faint[s] = true;
    }
  }
  size_t mixed = 0;
  std::set<std::vector<size_t>> combinations;
  for (size_t s = 0; s < count; ++s) {
    const bool one = std::ranges::adjacent_find(nearest[s], std::not_equal_to<>()) ==
                     nearest[s].end();  // all parts of one member
    if (one || faint[s]) continue;
    ++mixed;
    combinations.insert(nearest[s]);
  }
  const auto share = [&](size_t some) { return double(some) / double(count); };
  return {
      {"parts", rows}, {"mixed_share", share(mixed)}, {"combinations", share(combinations.size())}};
}

}  // namespace figurine::generation
