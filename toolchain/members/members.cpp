#include "toolchain/members/members.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "toolchain/json_number.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/measure/union_error.h"

namespace figurine::members {

using measure::ComparedPictures;
using measure::histogram;
using measure::pearson_correlation;
using measure::quantile;
using measure::rms_distances;
using measure::RowMatrix;
using measure::spearman_correlation;
using measure::summarise;
using measure::Summary;

namespace {

constexpr const char* kRankedBy = "psnr_pose_db";
constexpr size_t kNamedMembers = 10, kNamedPairs = 10, kBins = 20;
constexpr Split kSplits[] = {Split::kTrain, Split::kValidation, Split::kTest};

double to_db(double mse) {
  return mse > 0 ? -10 * std::log10(mse) : std::numeric_limits<double>::infinity();
}

// Of the members that `wanted` accepts; null if it accepts none.
template <class Wanted>
nlohmann::json describe_part(const Population& population, Wanted&& wanted) {
  nlohmann::json part;
  for (size_t q = 0; q < population.quality_names.size(); ++q) {
    std::vector<double> values;
    for (const PopulationMember& member : population.members) {
      if (wanted(member)) values.push_back(member.quality[q]);
    }
    if (values.empty()) return nullptr;
    const Summary summary = summarise(values);
    part[population.quality_names[q]] = {{"mean", finite(summary.mean)},
                                         {"worst", finite(summary.least)},
                                         {"best", finite(summary.greatest)},
                                         {"standard_deviation", finite(summary.standard_deviation)},
                                         {"count", summary.count}};
  }
  return part;
}

// A kind of distance: its name, its values and what they are in the report's unit.
struct Measure {
  const char* unit;
  const RowMatrix* values;  // [M,N], smaller is nearer
  double (*shown)(double);
};

double as_it_is(double value) { return value; }

// The nearest training member of a row, itself left out.
size_t nearest(const RowMatrix& values, size_t row) {
  size_t best = row == 0 ? 1 : 0;
  for (size_t n = 0; n < size_t(values.cols()); ++n) {
    if (n != row &&
        values(Eigen::Index(row), Eigen::Index(n)) < values(Eigen::Index(row), Eigen::Index(best)))
      best = n;
  }
  return best;
}

nlohmann::json describe_quantiles(const std::vector<double>& values) {
  nlohmann::json quantiles;
  for (const auto& [name, share] : {std::pair{"0", 0.0},
                                    {"5", 0.05},
                                    {"25", 0.25},
                                    {"50", 0.5},
                                    {"75", 0.75},
                                    {"95", 0.95},
                                    {"100", 1.0}}) {
    quantiles[name] = finite(quantile(values, share));
  }
  return quantiles;
}

struct Pair {
  size_t a = 0, b = 0;  // rows
  double value = 0;
};

std::vector<Pair> training_pairs(const RowMatrix& values) {
  std::vector<Pair> pairs;
  for (size_t a = 0; a < size_t(values.cols()); ++a) {
    for (size_t b = a + 1; b < size_t(values.cols()); ++b)
      pairs.push_back({a, b, values(Eigen::Index(a), Eigen::Index(b))});
  }
  return pairs;
}

nlohmann::json describe_histogram(const std::vector<double>& pairs,
                                  const std::vector<double>& nearest_of_all) {
  std::vector<double> all = pairs;
  all.insert(all.end(), nearest_of_all.begin(), nearest_of_all.end());
  const Summary range = summarise(all);
  const auto count = [&](const std::vector<double>& values) {
    return histogram(values, range.least, range.greatest, kBins);
  };
  return {{"low", finite(range.least)},
          {"high", finite(range.greatest)},
          {"training_pairs", count(pairs)},
          {"training_nearest", count(nearest_of_all)}};
}

nlohmann::json describe_measure(const MemberSet& set, const MemberDistances& distances,
                                const Measure& measure) {
  const RowMatrix& values = *measure.values;
  nlohmann::json report{{"unit", measure.unit}}, closest = nlohmann::json::array();
  std::vector<double> training_nearest, pair_values;
  for (const Split split : kSplits) {
    std::vector<double> own;
    for (size_t row = 0; row < distances.members.size(); ++row) {
      if (set.population().members[distances.members[row]].split != split) continue;
      own.push_back(measure.shown(values(Eigen::Index(row), Eigen::Index(nearest(values, row)))));
    }
    if (split == Split::kTrain) training_nearest = own;
    report[std::string(to_string(split)) + "_nearest_quantiles"] =
        own.empty() ? nlohmann::json(nullptr) : describe_quantiles(own);
  }
  std::vector<Pair> pairs = training_pairs(values);
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& x, const Pair& y) { return x.value < y.value; });
  for (const Pair& pair : pairs) {
    pair_values.push_back(measure.shown(pair.value));
    if (closest.size() >= kNamedPairs) continue;
    closest.push_back({{"a", set.name(distances.members[pair.a])},
                       {"b", set.name(distances.members[pair.b])},
                       {"distance", finite(pair_values.back())}});
  }
  report["histogram"] = describe_histogram(pair_values, training_nearest);
  report["closest_pairs"] = closest;
  return report;
}

std::vector<double> values_of(const std::vector<Pair>& pairs, double (*shown)(double)) {
  std::vector<double> values;
  for (const Pair& pair : pairs) values.push_back(shown(pair.value));
  return values;
}

// Takes pairs one after the other, none twice, and no member twice as long as there are enough.
class PairChooser {
 public:
  explicit PairChooser(const MemberDistances& distances) : distances_(&distances) {}

  // place: in the ascending order of the values, 0 the closest pair and 1 the farthest.
  void take(const RowMatrix& values, double place, const std::string& why) {
    std::vector<Pair> fresh, strangers;
    for (const Pair& pair : training_pairs(values)) {
      if (pairs_.contains({pair.a, pair.b})) continue;
      fresh.push_back(pair);
      if (!members_.contains(pair.a) && !members_.contains(pair.b)) strangers.push_back(pair);
    }
    std::vector<Pair>& from = strangers.empty() ? fresh : strangers;
    if (from.empty()) return;
    std::sort(from.begin(), from.end(),
              [](const Pair& x, const Pair& y) { return x.value < y.value; });
    const Pair& chosen =
        from[static_cast<size_t>(place * static_cast<double>(from.size() - 1) + 0.5)];
    pairs_.insert({chosen.a, chosen.b});
    members_.insert({chosen.a, chosen.b});
    chosen_.push_back({distances_->members[chosen.a], distances_->members[chosen.b], why});
  }
  std::vector<MixedPair> chosen() && { return std::move(chosen_); }

 private:
  const MemberDistances* distances_;
  std::set<std::pair<size_t, size_t>> pairs_;
  std::set<size_t> members_;
  std::vector<MixedPair> chosen_;
};

}  // namespace

std::vector<size_t> worst_members(const Population& population, size_t count) {
  const auto name =
      std::find(population.quality_names.begin(), population.quality_names.end(), kRankedBy);
  std::vector<size_t> members;
  if (name == population.quality_names.end()) return members;
  const auto quality = [&, q = size_t(name - population.quality_names.begin())](size_t m) {
    return population.members[m].quality[q];
  };
  for (size_t m = 0; m < population.size(); ++m) {
    if (std::isfinite(quality(m))) members.push_back(m);
  }
  std::stable_sort(members.begin(), members.end(),
                   [&](size_t a, size_t b) { return quality(a) < quality(b); });
  members.resize(std::min(count, members.size()));
  return members;
}

nlohmann::json describe_quality(const Population& population, size_t worst) {
  nlohmann::json report{
      {"all", describe_part(population, [](const PopulationMember&) { return true; })}};
  for (const Split split : kSplits) {
    report[to_string(split)] = describe_part(
        population, [&](const PopulationMember& member) { return member.split == split; });
  }
  report["worst_members"] = nlohmann::json::array();
  for (const size_t m : worst_members(population, worst)) {
    const PopulationMember& member = population.members[m];
    nlohmann::json row{{"name", member.name}, {"split", to_string(member.split)}};
    for (size_t q = 0; q < population.quality_names.size(); ++q)
      row[population.quality_names[q]] = finite(member.quality[q]);
    report["worst_members"].push_back(std::move(row));
  }
  return report;
}

MemberDistances::MemberDistances(const MemberSet& set)
    : members(set.training), training(set.training.size()) {
  members.insert(members.end(), set.held_out.begin(), set.held_out.end());
  const auto rows = static_cast<Eigen::Index>(members.size()),
             columns = static_cast<Eigen::Index>(training);
  weights.resize(rows, columns);
  weights.topRows(columns) =
      rms_distances(set.training_z, set.training_z, set.standardisation.varying());
  weights.bottomRows(rows - columns) =
      rms_distances(set.held_out_z, set.training_z, set.standardisation.varying());
  for (Eigen::Index n = 0; n < columns; ++n) weights(n, n) = 0;
  mse.resize(rows, columns);
  const ComparedPictures pictures(set.pictures);
  set.crew.run("comparing pictures", members.size(), [&](size_t row) {
    for (size_t n = 0; n < training; ++n)
      mse(Eigen::Index(row), Eigen::Index(n)) = pictures.error(members[row], members[n]).mse();
  });
}

nlohmann::json describe_distances(const MemberSet& set, const MemberDistances& distances) {
  nlohmann::json report{
      {"weights", describe_measure(set, distances, {"rms", &distances.weights, as_it_is})},
      {"pictures", describe_measure(set, distances, {"psnr_db", &distances.mse, to_db})}};
  const std::vector<double> weights = values_of(training_pairs(distances.weights), as_it_is);
  const std::vector<double> rmse =
      values_of(training_pairs(distances.mse), [](double mse) { return std::sqrt(mse); });
  report["correlation"] = {{"pearson", finite(pearson_correlation(weights, rmse))},
                           {"spearman", finite(spearman_correlation(weights, rmse))},
                           {"training_pairs", weights.size()}};
  for (size_t row = 0; row < distances.members.size(); ++row) {
    const size_t by_weights = nearest(distances.weights, row),
                 by_picture = nearest(distances.mse, row);
    report["members"].push_back(
        {{"name", set.name(distances.members[row])},
         {"split", to_string(set.population().members[distances.members[row]].split)},
         {"weights",
          {{"nearest", set.name(distances.members[by_weights])},
           {"rms", distances.weights(Eigen::Index(row), Eigen::Index(by_weights))}}},
         {"pictures",
          {{"nearest", set.name(distances.members[by_picture])},
           {"psnr_db",
            finite(to_db(distances.mse(Eigen::Index(row), Eigen::Index(by_picture))))}}}});
  }
  return report;
}

std::vector<MixedPair> choose_pairs(const MemberDistances& distances) {
  PairChooser chooser(distances);
  chooser.take(distances.weights, 1, "farthest in weights");
  chooser.take(distances.mse, 1, "farthest in pictures");
  chooser.take(distances.mse, 0.5, "middling in pictures");
  return std::move(chooser).chosen();
}

nlohmann::json evaluate_members(const MemberSet& set, const MemberDistances& distances,
                                const std::vector<MixedPair>& pairs,
                                const measure::PartExchange* parts, const MembersOptions& options) {
  const Population& population = set.population();
  nlohmann::json counts;
  for (const Split split : kSplits) {
    counts[to_string(split)] =
        std::count_if(population.members.begin(), population.members.end(),
                      [&](const auto& member) { return member.split == split; });
  }
  const MemberBases bases = make_bases(set);
  nlohmann::json report{
      {"name", population.name},
      {"preset", population.preset},
      {"members", counts},
      {"pictures",
       {{"poses", 2}, {"views", kComparedShots / 2}, {"size", {set.picture_px, set.picture_px}}}},
      {"quality", describe_quality(population, kNamedMembers)},
      {"distances", describe_distances(set, distances)},
      {"spectrum", describe_spectrum(set, bases)},
      {"span", measure_span(set, bases, options.ranks)},
      {"interpolation", measure_interpolation(set, pairs)},
      {"part_mixtures", nullptr}};
  if (parts != nullptr) report["part_mixtures"] = measure_part_mixtures(set, *parts, pairs);
  report["span_db"] = nullptr;
  if (!report["span"].is_null()) {
    for (const nlohmann::json& row : report["span"]["per_layer"])
      report["span_db"][std::to_string(row.at("rank").get<uint32_t>())] = row.at("span_db");
  }
  return report;
}

}  // namespace figurine::members
