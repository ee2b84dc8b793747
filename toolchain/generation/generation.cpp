#include "toolchain/generation/generation.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "figurine/check.h"
#include "toolchain/error.h"
#include "toolchain/generation/baselines.h"
#include "toolchain/generation/comparison_report.h"
#include "toolchain/generation/networks.h"
#include "toolchain/generation/novelty.h"
#include "toolchain/generation/people_distances.h"
#include "toolchain/measure/bootstrap.h"
#include "toolchain/measure/pooled_errors.h"
#include "toolchain/measure/sample_metrics.h"
#include "toolchain/measure/statistics.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::generation {

using measure::BootstrapOptions;
using measure::ComparedPictures;
using measure::foreground_error;
using measure::high_pass;
using measure::Picture;
using measure::PrincipalBasis;
using measure::psnr_db;
using measure::quantile;
using measure::rms_distances;
using measure::RowMatrix;
using measure::RowVector;
using measure::SquaredError;
using measure::Token;
using measure::union_error;
using measure::WeightStorage;
using members::kComparedShots;
using members::MemberSet;
using train::OpenedMember;

namespace {

constexpr size_t kMostAveraged = 5;
constexpr size_t kNoisedTried = 12;  // members that the level of noise is matched on

// A person of standardised weights, drawn. All else is the first training member's, which the
// others share.
std::vector<Picture> draw_row(const MemberSet& set, const RowVector& z) {
  const OpenedMember like(set.population(), set.training.front());
  const RowVector weights = set.standardisation.restore(z);
  WeightStorage storage;
  return set.draw(set.layout.with(like.avatar, {weights.data(), size_t(weights.size())}, storage));
}

People draw_rows(const MemberSet& set, const std::string& name, const RowMatrix& z) {
  People pictures(static_cast<size_t>(z.rows()));
  set.crew.run("drawing " + name, pictures.size(),
               [&](size_t i) { pictures[i] = draw_row(set, z.row(static_cast<Eigen::Index>(i))); });
  return pictures;
}

People pictures_of(const MemberSet& set, const std::vector<size_t>& members) {
  People pictures;
  for (const size_t member : members) pictures.push_back(set.pictures[member]);
  return pictures;
}

// Mean squared errors of all pairs, over both foregrounds: [A,B].
RowMatrix errors_between(const MemberSet& set, const std::string& what, const People& a,
                         const People& b) {
  People all = a;
  all.insert(all.end(), b.begin(), b.end());
  const ComparedPictures compared(all);
  RowMatrix mse(static_cast<Eigen::Index>(a.size()), static_cast<Eigen::Index>(b.size()));
  set.crew.run("comparing " + what, a.size(), [&](size_t i) {
    for (size_t j = 0; j < b.size(); ++j) {
      mse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          compared.error(i, a.size() + j).mse();
    }
  });
  return mse;
}

// The same of one set: symmetric, zeros on the diagonal.
RowMatrix errors_within(const MemberSet& set, const std::string& what, const People& a) {
  const ComparedPictures compared(a);
  RowMatrix mse =
      RowMatrix::Zero(static_cast<Eigen::Index>(a.size()), static_cast<Eigen::Index>(a.size()));
  set.crew.run("comparing " + what, a.size(), [&](size_t i) {
    for (size_t j = 0; j < a.size(); ++j) {
      if (i != j)
        mse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            compared.error(i, j).mse();
    }
  });
  return mse;
}

double sharpness(const People& people) {
  double energy = 0, pixels = 0;
  for (const std::vector<Picture>& pictures : people) {
    for (const Picture& picture : pictures) {
      energy += high_pass(picture, picture).truth;
      pixels += static_cast<double>(foreground_error(picture, picture).count) / 3;
    }
  }
  return pixels > 0 ? energy / pixels : 0;
}

nlohmann::json compare(RowMatrix to_references, RowMatrix samples, RowMatrix references,
                       const BootstrapOptions& bootstrap) {
  return describe_draws({std::move(to_references), std::move(samples), std::move(references)},
                        DistanceUnit::kSquaredError, bootstrap);
}

nlohmann::json describe(const std::vector<BlendShare>& blends) {
  nlohmann::json rows = nlohmann::json::array();
  for (const BlendShare& blend : blends) {
    rows.push_back({{"members", blend.members},
                    {"median_residual", blend.median_residual},
                    {"explained_share", blend.explained_share}});
  }
  return rows;
}

// What every row is held against.
struct References {
  People training, held_out, captures;  // the last may be empty
  RowMatrix training_mse, held_out_mse, captures_mse, training_distances;
  double training_sharpness = 0;

  References(const MemberSet& set, const People& captured)
      : training(pictures_of(set, set.training)),
        held_out(pictures_of(set, set.held_out)),
        captures(captured),
        training_mse(errors_within(set, "training members", training)),
        held_out_mse(errors_within(set, "held-out members", held_out)),
        captures_mse(errors_within(set, "captures", captures)),
        training_distances(
            rms_distances(set.training_z, set.training_z, set.standardisation.varying())),
        training_sharpness(sharpness(training)) {}
};

// Adds "held_out_captures" to a row: draws of as many of its people as there are captures; nothing
// without captures. within: the row's own errors.
void compare_with_captures(const MemberSet& set, const References& references,
                           const std::string& name, const People& people, const RowMatrix& within,
                           const BootstrapOptions& bootstrap, nlohmann::json& row) {
  if (references.captures.empty()) return;
  row["held_out_captures"] =
      compare(errors_between(set, name + ", captures", people, references.captures), within,
              references.captures_mse, bootstrap);
}

// How far every held-out member is from who it was learnt from: what a perfect sampler of members
// would leave.
nlohmann::json describe_captures(const References& references) {
  std::vector<double> db;
  for (size_t i = 0; i < references.captures.size(); ++i)
    db.push_back(union_error(references.held_out[i], references.captures[i]).psnr_db());
  const auto [lowest, highest] = std::ranges::minmax(db);
  const double mean = std::accumulate(db.begin(), db.end(), 0.0) / static_cast<double>(db.size());
  return {
      {"kind", "the held-out people themselves, by the recipe, drawn by the captures' renderer"},
      {"held_out", db.size()},
      {"render_to_capture_db",
       {{"mean", finite(mean)}, {"lowest", finite(lowest)}, {"highest", finite(highest)}}}};
}

nlohmann::json audit(const MemberSet& set, const References& references, const RowMatrix& z,
                     const People& pictures, const RowMatrix& to_training_mse,
                     Eigen::Index learnt) {
  const RowMatrix learnt_z = set.training_z.topRows(learnt);
  const Novelty weights =
      measure_novelty(rms_distances(z, learnt_z, set.standardisation.varying()),
                      references.training_distances.topLeftCorner(learnt, learnt));
  const Novelty seen = measure_novelty(to_training_mse.leftCols(learnt),
                                       references.training_mse.topLeftCorner(learnt, learnt));
  nlohmann::json of_pictures = describe(seen);
  of_pictures["median_nearest_db"] =
      finite(psnr_db(of_pictures.at("median_nearest").get<double>()));
  of_pictures["copy_distance_db"] = finite(psnr_db(seen.copy_distance));
  return {{"novelty", {{"weights", describe(weights)}, {"pictures", of_pictures}}},
          {"blends", describe(measure_blends(z, learnt_z))},
          {"highpass_ratio", sharpness(pictures) / references.training_sharpness}};
}

BootstrapOptions bootstrap_of(const GenerationOptions& options) {
  return {.replicates = options.replicates, .seed = options.seed};
}

nlohmann::json evaluate_row(const MemberSet& set, const References& references,
                            const GenerationNetworks& networks, const Generated& generated,
                            const BootstrapOptions& bootstrap) {
  const auto training = static_cast<Eigen::Index>(references.training.size());
  const RowMatrix z = generated.z.topRows(training);
  const People pictures = draw_rows(set, generated.name, z);
  const RowMatrix to_training =
      errors_between(set, generated.name + ", training", pictures, references.training);
  const RowMatrix to_held_out =
      errors_between(set, generated.name + ", held-out", pictures, references.held_out);
  const RowMatrix within = errors_within(set, generated.name, pictures);
  const auto learnt = generated.learnt > 0 ? static_cast<Eigen::Index>(generated.learnt) : training;
  nlohmann::json row = audit(set, references, z, pictures, to_training, learnt);
  row["name"] = generated.name;
  row["samples"] = z.rows();
  row["learnt_from"] = learnt;
  row["held_out"] = compare(to_held_out, within, references.held_out_mse, bootstrap);
  row["train"] = compare(to_training, within, references.training_mse, bootstrap);
  compare_with_captures(set, references, generated.name, pictures, within, bootstrap, row);
  networks.add_samples(pictures, learnt, row);
  return row;
}

// Noise whose pictures are as far from their member as wanted: deviations double or halve until
// they enclose it, then bisect.
double match_noise(const MemberSet& set, double wanted_db, uint64_t seed) {
  const auto picture_db = [&](double deviation) {
    const size_t tried = std::min(kNoisedTried, set.training.size());
    std::vector<SquaredError> errors(tried);
    set.crew.run("matching noise", tried, [&](size_t i) {
      const RowMatrix noised =
          draw_noised_members(set.training_z.middleRows(static_cast<Eigen::Index>(i), 1), deviation,
                              {.count = 1, .seed = seed, .first = i});
      errors[i] = union_error(draw_row(set, noised.row(0)), set.pictures[set.training[i]]);
    });
    SquaredError sum;
    for (const SquaredError& error : errors) sum.add(error);
    return sum.psnr_db();
  };
  double low = 1e-3, high = 1;
  for (int i = 0; i < 8; ++i) {
    const double middle = std::sqrt(low * high);
    (picture_db(middle) > wanted_db ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace

std::vector<Generated> make_baselines(const MemberSet& set, size_t rank, double noised_db,
                                      uint64_t seed) {
  const size_t count = set.training.size();
  const Draw draw{.count = count, .seed = seed};
  std::vector<Generated> baselines;
  RowMatrix gaussian = RowMatrix::Zero(static_cast<Eigen::Index>(count), set.training_z.cols());
  uint64_t stream = seed;
  for (const Token& token : set.standardisation.tokens()) {
    const PrincipalBasis basis(set.training_z, token.begin, token.size);
    const size_t kept = std::min(rank, basis.rank());
    ++stream;  // tokens are drawn apart
    if (kept == 0) continue;
    const RowMatrix directions = basis.directions(kept);
    const auto part = [&](const RowMatrix& rows) {
      return rows.middleCols(static_cast<Eigen::Index>(token.begin),
                             static_cast<Eigen::Index>(token.size));
    };
    const RowMatrix coordinates = part(set.training_z) * directions.transpose();
    gaussian.middleCols(static_cast<Eigen::Index>(token.begin),
                        static_cast<Eigen::Index>(token.size)) =
        draw_independent_gaussian(coordinates, {.count = count, .seed = stream}) * directions;
  }
  baselines.push_back({"Gaussian in the basis, tokens apart", std::move(gaussian)});
  baselines.push_back({"Gaussian of the members", draw_gaussian(set.training_z, draw)});
  for (size_t m = 2; m <= std::min(kMostAveraged, count); ++m) {
    baselines.push_back(
        {"average of " + std::to_string(m) + " members", draw_averages(set.training_z, m, draw)});
  }
  baselines.push_back(
      {"member + noise",
       draw_noised_members(set.training_z, match_noise(set, noised_db, seed), draw)});
  baselines.push_back({"perfect memoriser", draw_members(set.training_z, draw)});
  return baselines;
}

nlohmann::json evaluate_generation(const MemberSet& set, const std::vector<Generated>& generated,
                                   const GenerationOptions& options) {
  if (set.held_out.size() < 2)
    throw InputError("population '" + set.population().name +
                     "': has fewer than two held-out members");
  if (set.held_out.size() > set.training.size()) {
    throw InputError("population '" + set.population().name +
                     "': has more held-out members than training ones");
  }
  FIG_CHECK(options.captures.empty() || options.captures.size() == set.held_out.size(),
            "a capture of every held-out member");
  const References references(set, options.captures);
  const BootstrapOptions bootstrap = bootstrap_of(options);
  const GenerationNetworks networks(options.networks, references.training, references.held_out,
                                    options.threads, bootstrap);
  nlohmann::json rows = nlohmann::json::array();
  for (const Generated& one : generated) {
    if (one.z.rows() < static_cast<Eigen::Index>(set.training.size()))
      throw InputError(one.name + ": fewer samples than training members");
    if (one.learnt == 1 || one.learnt > set.training.size())
      throw InputError(one.name + ": learnt from other members than these");
    rows.push_back(evaluate_row(set, references, networks, one, bootstrap));
  }
  const RowMatrix to_training =
      errors_between(set, "held-out members", references.held_out, references.training);
  nlohmann::json held_out = audit(set, references, set.held_out_z, references.held_out, to_training,
                                  set.training_z.rows());
  held_out["name"] = "held-out members";
  held_out["samples"] = set.held_out.size();
  compare_with_captures(set, references, "held-out members", references.held_out,
                        references.held_out_mse, bootstrap, held_out);
  networks.add_held_out_novelty(held_out);
  // Training members as if they had been sampled: what "within 1 dB of training members" is
  // measured from.
  nlohmann::json members{{"name", "training members"},
                         {"samples", set.training.size()},
                         {"held_out", compare(to_training.transpose(), references.training_mse,
                                              references.held_out_mse, bootstrap)}};
  compare_with_captures(set, references, "training members", references.training,
                        references.training_mse, bootstrap, members);
  networks.add_training_as_samples(members);
  rows.push_back(std::move(members));
  rows.push_back(std::move(held_out));
  nlohmann::json about{{"kind", "renders of trained avatars by the device's renderer, float"},
                       {"training", set.training.size()},
                       {"held_out", set.held_out.size()},
                       {"shots", kComparedShots},
                       {"picture_px", set.picture_px}};
  if (!references.captures.empty()) about["captures"] = describe_captures(references);
  return {{"population", set.population().name},
          {"population_hash", format_hash(set.package->content_hash())},
          {"references", about},
          {"bootstrap",
           {{"replicates", options.replicates}, {"seed", options.seed}, {"confidence", 0.95}}},
          {"rows", rows}};
}

double nearest_member_db(const MemberSet& set, const Generated& generated, size_t most) {
  const RowMatrix z =
      generated.z.topRows(std::min(generated.z.rows(), static_cast<Eigen::Index>(most)));
  const RowMatrix mse = errors_between(set, "nearest members", draw_rows(set, generated.name, z),
                                       pictures_of(set, set.training));
  std::vector<double> nearest;
  for (Eigen::Index i = 0; i < mse.rows(); ++i) nearest.push_back(mse.row(i).minCoeff());
  return psnr_db(quantile(nearest, 0.5));
}

}  // namespace figurine::generation
