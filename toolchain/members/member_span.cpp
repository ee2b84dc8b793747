#include "toolchain/members/member_span.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "toolchain/json_number.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::directions_for;
using measure::foreground_error;
using measure::participation_ratio;
using measure::Picture;
using measure::PrincipalBasis;
using measure::RowVector;
using measure::SquaredError;
using measure::summarise;
using measure::Token;
using measure::union_error;
using measure::WeightLayout;
using measure::WeightStorage;
using train::OpenedMember;

namespace {

nlohmann::json describe(const PrincipalBasis& basis, size_t entries) {
  const Eigen::VectorXd& variance = basis.variance();
  nlohmann::json shares = nlohmann::json::array();
  for (Eigen::Index k = 0; k < variance.size(); ++k) shares.push_back(variance[k] / variance.sum());
  return {{"entries", entries},
          {"shared", basis.size() - entries},
          {"directions", basis.rank()},
          {"directions_for",
           {{"50", directions_for(variance, 0.5)},
            {"90", directions_for(variance, 0.9)},
            {"99", directions_for(variance, 0.99)}}},
          {"participation_ratio", participation_ratio(variance)},
          {"variance_share", shares}};
}

// What one way of replacing held-out members loses: in weights, and in pictures against the
// member's own.
struct Replacement {
  explicit Replacement(size_t held_out) : lost(held_out), all(held_out), error(held_out) {}
  std::vector<double> lost, all;    // [H] squared distance to it, and to the training mean
  std::vector<SquaredError> error;  // [H] foreground of the member's own pictures, all shots
};

SquaredError error_to(const std::vector<Picture>& own, const std::vector<Picture>& replaced) {
  SquaredError error;
  for (size_t i = 0; i < own.size(); ++i) error.add(foreground_error(replaced[i], own[i]));
  return error;
}

nlohmann::json describe(const MemberSet& set, const Replacement& replacement) {
  SquaredError pooled;
  double lost = 0, all = 0, worst_db = std::numeric_limits<double>::infinity(), most_lost = 0;
  std::vector<double> each_db;
  size_t worst = 0;
  for (size_t h = 0; h < set.held_out.size(); ++h) {
    pooled.add(replacement.error[h]);
    each_db.push_back(replacement.error[h].psnr_db());
    lost += replacement.lost[h];
    all += replacement.all[h];
    most_lost = std::max(most_lost, replacement.lost[h] / replacement.all[h]);
    if (each_db.back() < worst_db) worst_db = each_db.back(), worst = h;
  }
  return {{"variance_kept", finite(1 - lost / all)},
          {"worst_variance_kept", finite(1 - most_lost)},
          {"span_db", finite(pooled.psnr_db())},
          {"mean_db", finite(summarise(each_db).mean)},
          {"worst_db", finite(worst_db)},
          {"worst_member", set.name(set.held_out[worst])}};
}

// A rank's projection of a held-out member: by the tokens' bases, or by the whole's alone.
class Projector {
 public:
  Projector(const MemberBases& bases, const RowVector& z)
      : bases_(&bases), of_whole_(bases.whole.coordinates(z)) {
    for (const PrincipalBasis& basis : bases.tokens) of_token_.push_back(basis.coordinates(z));
  }
  RowVector per_layer(size_t rank) const {
    RowVector projected(static_cast<Eigen::Index>(bases_->whole.size()));
    for (size_t t = 0; t < bases_->tokens.size(); ++t) {
      const PrincipalBasis& basis = bases_->tokens[t];
      projected.segment(Eigen::Index(basis.begin()), Eigen::Index(basis.size())) =
          basis.combine(of_token_[t], rank);
    }
    return projected;
  }
  RowVector whole(size_t rank) const { return bases_->whole.combine(of_whole_, rank); }

 private:
  const MemberBases* bases_;
  std::vector<Eigen::VectorXd> of_token_;
  Eigen::VectorXd of_whole_;
};

std::vector<uint32_t> sound_ranks(std::vector<uint32_t> ranks, size_t members) {
  const auto most = static_cast<uint32_t>(members - 1);
  std::erase_if(ranks, [&](uint32_t rank) { return rank == 0 || rank > most; });
  ranks.push_back(most);
  std::sort(ranks.begin(), ranks.end());
  ranks.erase(std::unique(ranks.begin(), ranks.end()), ranks.end());
  return ranks;
}

// Everything that is tried on held-out members.
struct Replacements {
  std::vector<Replacement> per_layer, whole;      // [ranks]
  std::vector<std::vector<Replacement>> by_kind;  // [kinds][ranks]
  Replacement mean, nearest_weights, nearest_picture;
};

void replace_member(const MemberSet& set, const MemberBases& bases,
                    const std::vector<uint32_t>& ranks, size_t h, Replacements& out) {
  const OpenedMember opened(set.population(), set.held_out[h]);
  const std::vector<Picture>& own = set.pictures[set.held_out[h]];
  const RowVector z = set.held_out_z.row(Eigen::Index(h));
  RowVector own_weights(z.size());
  set.layout.read(opened.avatar, {own_weights.data(), size_t(own_weights.size())});
  WeightStorage storage;
  // Instead of all values, or of a stretch of them: the others stay the member's own to the bit.
  const auto try_stretch = [&](const RowVector& instead, Eigen::Index begin, Eigen::Index size,
                               Replacement& replacement) {
    RowVector weights = own_weights;
    weights.segment(begin, size) = set.standardisation.restore(instead).segment(begin, size);
    replacement.lost[h] = (z - instead).segment(begin, size).squaredNorm();
    replacement.all[h] = z.segment(begin, size).squaredNorm();
    Avatar replaced =
        set.layout.with(opened.avatar, {weights.data(), size_t(weights.size())}, storage);
    // A map that is not replaced is not rounded anew either.
    if (static_cast<size_t>(begin + size) <= set.layout.network_size())
      replaced.static_part = opened.avatar.static_part;
    replacement.error[h] = error_to(own, set.draw(replaced));
  };
  const auto try_weights = [&](const RowVector& instead, Replacement& replacement) {
    try_stretch(instead, 0, instead.size(), replacement);
  };
  const Projector projector(bases, z);
  for (size_t i = 0; i < ranks.size(); ++i) {
    const RowVector per_layer = projector.per_layer(ranks[i]);
    try_weights(per_layer, out.per_layer[i]);
    try_weights(projector.whole(ranks[i]), out.whole[i]);
    for (size_t k = 0; k < bases.kinds.size(); ++k) {
      const PrincipalBasis& basis = bases.kinds[k].basis;
      try_stretch(per_layer, Eigen::Index(basis.begin()), Eigen::Index(basis.size()),
                  out.by_kind[k][i]);
    }
  }
  try_weights(RowVector::Zero(z.size()), out.mean);
  const auto try_member = [&](size_t n, Replacement& replacement) {
    replacement.lost[h] = (z - set.training_z.row(Eigen::Index(n))).squaredNorm();
    replacement.all[h] = z.squaredNorm();
    replacement.error[h] = error_to(own, set.pictures[set.training[n]]);
  };
  Eigen::Index nearest = 0;
  (set.training_z.rowwise() - z).rowwise().squaredNorm().minCoeff(&nearest);
  try_member(size_t(nearest), out.nearest_weights);
  std::vector<double> errors;
  for (const size_t member : set.training)
    errors.push_back(union_error(own, set.pictures[member]).mse());
  try_member(size_t(std::min_element(errors.begin(), errors.end()) - errors.begin()),
             out.nearest_picture);
}

size_t varying(const MemberSet& set, const WeightLayout::TokenRange& tokens) {
  size_t sum = 0;
  for (size_t t = tokens.first; t < tokens.end; ++t) sum += set.standardisation.varying(t);
  return sum;
}

nlohmann::json describe_ranks(const MemberSet& set, const std::vector<uint32_t>& ranks,
                              const std::vector<Replacement>& tried) {
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < ranks.size(); ++i) {
    nlohmann::json row{{"rank", ranks[i]}};
    row.update(describe(set, tried[i]));
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

MemberBases make_bases(const MemberSet& set) {
  const std::vector<Token>& tokens = set.standardisation.tokens();
  struct Stretch {
    size_t begin, size;
  };
  std::vector<Stretch> stretches;  // of the tokens, of the kinds, of all
  for (const Token& token : tokens) stretches.push_back({token.begin, token.size});
  std::vector<std::pair<std::string, WeightLayout::TokenRange>> kinds;
  for (const auto& [name, range] :
       {std::pair{"kernels", set.layout.kernels()}, std::pair{"map", set.layout.map()}}) {
    if (range.empty()) continue;
    const Token& last = tokens[range.end - 1];
    const size_t begin = tokens[range.first].begin;
    stretches.push_back({begin, last.begin + last.size - begin});
    kinds.emplace_back(name, range);
  }
  stretches.push_back({0, size_t(set.training_z.cols())});
  std::vector<std::optional<PrincipalBasis>> found(stretches.size());
  set.crew.run("principal directions", stretches.size(), [&](size_t i) {
    found[i].emplace(set.training_z, stretches[i].begin, stretches[i].size);
  });
  MemberBases bases{{}, {}, std::move(*found.back())};
  for (size_t t = 0; t < tokens.size(); ++t) bases.tokens.push_back(std::move(*found[t]));
  for (size_t k = 0; k < kinds.size(); ++k) {
    bases.kinds.push_back({kinds[k].first, kinds[k].second, std::move(*found[tokens.size() + k])});
  }
  return bases;
}

nlohmann::json describe_spectrum(const MemberSet& set, const MemberBases& bases) {
  nlohmann::json tokens = nlohmann::json::array(), by_kind = nlohmann::json::object();
  for (size_t t = 0; t < bases.tokens.size(); ++t) {
    nlohmann::json token{{"name", set.standardisation.tokens()[t].name},
                         {"scale", set.standardisation.scale(t)}};
    token.update(describe(bases.tokens[t], set.standardisation.varying(t)));
    tokens.push_back(std::move(token));
  }
  for (const MemberBases::Kind& kind : bases.kinds) {
    by_kind[kind.name] = describe(kind.basis, varying(set, kind.tokens));
    by_kind[kind.name]["share_of_whole"] =
        finite(kind.basis.variance().sum() / bases.whole.variance().sum());
  }
  return {{"whole", describe(bases.whole, set.standardisation.varying())},
          {"by_kind", by_kind},
          {"tokens", tokens}};
}

nlohmann::json measure_span(const MemberSet& set, const MemberBases& bases,
                            std::vector<uint32_t> ranks) {
  const size_t held_out = set.held_out.size();
  if (held_out == 0) return nullptr;
  ranks = sound_ranks(std::move(ranks), set.training.size());
  const Replacement none(held_out);
  const std::vector<Replacement> of_ranks(ranks.size(), none);
  Replacements tried{.per_layer = of_ranks,
                     .whole = of_ranks,
                     .by_kind = std::vector(bases.kinds.size(), of_ranks),
                     .mean = none,
                     .nearest_weights = none,
                     .nearest_picture = none};
  set.crew.run("projecting held-out members", held_out,
               [&](size_t h) { replace_member(set, bases, ranks, h, tried); });
  nlohmann::json span{{"ranks", ranks},
                      {"held_out", held_out},
                      {"per_layer", describe_ranks(set, ranks, tried.per_layer)},
                      {"whole", describe_ranks(set, ranks, tried.whole)},
                      {"by_kind", nlohmann::json::object()},
                      {"baselines",
                       {{"training_mean", describe(set, tried.mean)},
                        {"nearest_in_weights", describe(set, tried.nearest_weights)},
                        {"nearest_in_pictures", describe(set, tried.nearest_picture)}}}};
  for (size_t k = 0; k < bases.kinds.size(); ++k)
    span["by_kind"][bases.kinds[k].name] = describe_ranks(set, ranks, tried.by_kind[k]);
  return span;
}

}  // namespace figurine::members
