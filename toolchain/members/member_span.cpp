#include "toolchain/members/member_span.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "toolchain/json_number.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::directions_for;
using measure::foreground_error;
using measure::high_pass;
using measure::participation_ratio;
using measure::Picture;
using measure::PrincipalBasis;
using measure::RowMatrix;
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
  explicit Replacement(size_t held_out) : lost(held_out, 0), error(held_out) {}
  std::vector<double> lost;         // [H] share of the squared distance to the training mean
  std::vector<SquaredError> error;  // [H] foreground of the member's own pictures, all shots
};

SquaredError error_to(const std::vector<Picture>& own, const std::vector<Picture>& replaced) {
  SquaredError error;
  for (size_t i = 0; i < own.size(); ++i) error.add(foreground_error(replaced[i], own[i]));
  return error;
}

nlohmann::json describe(const MemberSet& set, const Replacement& replacement,
                        const std::vector<double>& energy) {
  SquaredError pooled;
  double lost = 0, all = 0, worst_db = std::numeric_limits<double>::infinity(), most_lost = 0;
  std::vector<double> each_db;
  size_t worst = 0;
  for (size_t h = 0; h < set.held_out.size(); ++h) {
    pooled.add(replacement.error[h]);
    each_db.push_back(replacement.error[h].psnr_db());
    lost += replacement.lost[h] * energy[h];
    all += energy[h];
    most_lost = std::max(most_lost, replacement.lost[h]);
    if (each_db.back() < worst_db) worst_db = each_db.back(), worst = h;
  }
  return {{"variance_kept", 1 - lost / all},     {"worst_variance_kept", 1 - most_lost},
          {"span_db", finite(pooled.psnr_db())}, {"mean_db", finite(summarise(each_db).mean)},
          {"worst_db", finite(worst_db)},        {"worst_member", set.name(set.held_out[worst])}};
}

// A rank's projection of a held-out member: by the tokens' bases, or by the last one alone.
class Projector {
 public:
  Projector(const std::vector<PrincipalBasis>& bases, const RowVector& z) : bases_(&bases), z_(z) {
    for (const PrincipalBasis& basis : bases) coordinates_.push_back(basis.coordinates(z));
  }
  RowVector per_layer(size_t rank) const {
    RowVector projected = RowVector::Zero(z_.size());
    for (size_t t = 0; t + 1 < bases_->size(); ++t) {
      const PrincipalBasis& basis = (*bases_)[t];
      projected.segment(Eigen::Index(basis.begin()), Eigen::Index(basis.size())) =
          basis.combine(coordinates_[t], rank);
    }
    return projected;
  }
  RowVector whole(size_t rank) const { return bases_->back().combine(coordinates_.back(), rank); }

 private:
  const std::vector<PrincipalBasis>* bases_;
  RowVector z_;
  std::vector<Eigen::VectorXd> coordinates_;
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
  std::vector<Replacement> per_layer, whole;  // [ranks]
  Replacement mean, nearest_weights, nearest_picture;
};

void replace_member(const MemberSet& set, const std::vector<PrincipalBasis>& bases,
                    const std::vector<uint32_t>& ranks, size_t h, Replacements& out) {
  const OpenedMember opened(set.population(), set.held_out[h]);
  const std::vector<Picture>& own = set.pictures[set.held_out[h]];
  const RowVector z = set.held_out_z.row(Eigen::Index(h));
  const double energy = z.squaredNorm();
  WeightStorage storage;
  const auto try_weights = [&](const RowVector& instead, Replacement& replacement) {
    const RowVector weights = set.standardisation.restore(instead);
    replacement.lost[h] = (z - instead).squaredNorm() / energy;
    replacement.error[h] =
        error_to(own, set.draw(set.layout.with(opened.avatar,
                                               {weights.data(), size_t(weights.size())}, storage)));
  };
  const Projector projector(bases, z);
  for (size_t i = 0; i < ranks.size(); ++i) {
    try_weights(projector.per_layer(ranks[i]), out.per_layer[i]);
    try_weights(projector.whole(ranks[i]), out.whole[i]);
  }
  try_weights(RowVector::Zero(z.size()), out.mean);
  const auto try_member = [&](size_t n, Replacement& replacement) {
    replacement.lost[h] = (z - set.training_z.row(Eigen::Index(n))).squaredNorm() / energy;
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

double high_pass_energy(const std::vector<Picture>& pictures) {
  double energy = 0;
  for (const Picture& picture : pictures) energy += high_pass(picture, picture).truth;
  return energy;
}

double foreground_pixels(const std::vector<Picture>& pictures) {
  uint64_t values = 0;
  for (const Picture& picture : pictures) values += foreground_error(picture, picture).count;
  return static_cast<double>(values) / 3;
}

// The training members nearest to given standardised weights and pictures.
nlohmann::json nearest_to(const MemberSet& set, const RowVector& z,
                          const std::vector<Picture>& pictures) {
  Eigen::Index row = 0;
  const double squares = (set.training_z.rowwise() - z).rowwise().squaredNorm().minCoeff(&row);
  double best_db = -std::numeric_limits<double>::infinity();
  size_t best = 0;
  for (const size_t member : set.training) {
    const double psnr_db = union_error(pictures, set.pictures[member]).psnr_db();
    if (psnr_db > best_db) best_db = psnr_db, best = member;
  }
  const double rms = std::sqrt(squares / static_cast<double>(set.standardisation.varying()));
  return {{"weights", {{"member", set.name(set.training[size_t(row)])}, {"rms", rms}}},
          {"pictures", {{"member", set.name(best)}, {"psnr_db", finite(best_db)}}}};
}

struct Mixture {
  double energy = 0, foreground = 0;
  nlohmann::json nearest;
};

Mixture measure_mixture(const MemberSet& set, const MixedPair& pair, double share) {
  const OpenedMember a(set.population(), pair.a), b(set.population(), pair.b);
  WeightStorage storage;
  const Avatar mixed = mix(set.layout, a.avatar, b.avatar, share, storage);
  RowMatrix weights(1, set.training_z.cols());
  set.layout.read(mixed, {weights.data(), size_t(weights.size())});
  const std::vector<Picture> pictures = set.draw(mixed);
  return {high_pass_energy(pictures), foreground_pixels(pictures),
          nearest_to(set, set.standardisation.standardise(weights).row(0), pictures)};
}

}  // namespace

std::vector<PrincipalBasis> make_bases(const MemberSet& set) {
  const std::vector<Token>& tokens = set.standardisation.tokens();
  std::vector<PrincipalBasis> bases;
  for (const Token& token : tokens) bases.emplace_back(set.training_z, token.begin, token.size);
  bases.emplace_back(set.training_z, 0, size_t(set.training_z.cols()));
  return bases;
}

nlohmann::json describe_spectrum(const MemberSet& set, const std::vector<PrincipalBasis>& bases) {
  nlohmann::json tokens = nlohmann::json::array();
  for (size_t t = 0; t + 1 < bases.size(); ++t) {
    nlohmann::json token{{"name", set.standardisation.tokens()[t].name},
                         {"scale", set.standardisation.scale(t)}};
    token.update(describe(bases[t], set.standardisation.varying(t)));
    tokens.push_back(std::move(token));
  }
  return {{"whole", describe(bases.back(), set.standardisation.varying())}, {"tokens", tokens}};
}

nlohmann::json measure_span(const MemberSet& set, const std::vector<PrincipalBasis>& bases,
                            std::vector<uint32_t> ranks) {
  const size_t held_out = set.held_out.size();
  if (held_out == 0) return nullptr;
  ranks = sound_ranks(std::move(ranks), set.training.size());
  const Replacement none(held_out);
  Replacements tried{{ranks.size(), none}, {ranks.size(), none}, none, none, none};
  set.crew.run("projecting held-out members", held_out,
               [&](size_t h) { replace_member(set, bases, ranks, h, tried); });
  std::vector<double> energy;
  for (size_t h = 0; h < held_out; ++h)
    energy.push_back(set.held_out_z.row(Eigen::Index(h)).squaredNorm());
  nlohmann::json span{{"ranks", ranks}, {"held_out", held_out}};
  for (const auto& [name, list] :
       {std::pair{"per_layer", &tried.per_layer}, std::pair{"whole", &tried.whole}}) {
    for (size_t i = 0; i < ranks.size(); ++i) {
      nlohmann::json row{{"rank", ranks[i]}};
      row.update(describe(set, (*list)[i], energy));
      span[name].push_back(std::move(row));
    }
  }
  span["baselines"] = {{"training_mean", describe(set, tried.mean, energy)},
                       {"nearest_in_weights", describe(set, tried.nearest_weights, energy)},
                       {"nearest_in_pictures", describe(set, tried.nearest_picture, energy)}};
  return span;
}

Avatar mix(const WeightLayout& layout, const Avatar& a, const Avatar& b, double share,
           WeightStorage& storage) {
  const auto between = [&](float x, float y) {
    return static_cast<float>((1 - share) * x + share * y);
  };
  const size_t size = layout.size();
  std::vector<double> first(size), second(size);
  layout.read(a, first);
  layout.read(b, second);
  for (size_t i = 0; i < size; ++i) first[i] = (1 - share) * first[i] + share * second[i];
  Avatar mixed = layout.with(a, first, storage);
  for (size_t c = 0; c < kMapChannels; ++c) {
    mixed.map_statistics.mean[c] = between(a.map_statistics.mean[c], b.map_statistics.mean[c]);
    mixed.map_statistics.scale[c] = between(a.map_statistics.scale[c], b.map_statistics.scale[c]);
  }
  mixed.decoding.offset_scale_m = between(a.decoding.offset_scale_m, b.decoding.offset_scale_m);
  mixed.decoding.spacing_scale = between(a.decoding.spacing_scale, b.decoding.spacing_scale);
  mixed.decoding.max_log_scale = between(a.decoding.max_log_scale, b.decoding.max_log_scale);
  // Never less room than either end has; 0 is no bound.
  mixed.decoding.max_offset = a.decoding.max_offset == 0 || b.decoding.max_offset == 0
                                  ? 0
                                  : std::max(a.decoding.max_offset, b.decoding.max_offset);
  mixed.decoding.opacity_bias = between(a.decoding.opacity_bias, b.decoding.opacity_bias);
  return mixed;
}

nlohmann::json measure_interpolation(const MemberSet& set, const std::vector<MixedPair>& pairs) {
  constexpr size_t kSteps = std::size(kMixSteps);
  std::vector<Mixture> mixtures(pairs.size() * kSteps);
  set.crew.run("mixing members", mixtures.size(), [&](size_t i) {
    mixtures[i] = measure_mixture(set, pairs[i / kSteps], kMixSteps[i % kSteps]);
  });
  nlohmann::json report{{"steps", kMixSteps}, {"pairs", nlohmann::json::array()}};
  for (size_t p = 0; p < pairs.size(); ++p) {
    const Mixture *own = &mixtures[p * kSteps], &first = own[0], &last = own[kSteps - 1];
    nlohmann::json row{
        {"a", set.name(pairs[p].a)}, {"b", set.name(pairs[p].b)}, {"why", pairs[p].why}};
    for (size_t i = 0; i < kSteps; ++i) {
      row["steps"].push_back(
          {{"share", kMixSteps[i]},
           {"highpass_ratio", finite(2 * own[i].energy / (first.energy + last.energy))},
           {"foreground_ratio",
            finite(2 * own[i].foreground / (first.foreground + last.foreground))},
           {"nearest", own[i].nearest}});
    }
    row["middle_highpass_ratio"] = row["steps"][kSteps / 2]["highpass_ratio"];
    report["pairs"].push_back(std::move(row));
  }
  return report;
}

}  // namespace figurine::members
