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
#include "toolchain/generation/part_diversity.h"
#include "toolchain/generation/people_distances.h"
#include "toolchain/json_number.h"
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
constexpr size_t kNamed = 16;        // samples whose nearest member is named
constexpr size_t kNoisedTried = 12;  // members that the level of noise is matched on

// The avatar of standardised weights. All else is the first training member's, which the others
// share.
template <class Visit>
void visit_row(const MemberSet& set, const RowVector& z, Visit&& visit) {
  const OpenedMember like(set.population(), set.training.front());
  const RowVector weights = set.standardisation.restore(z);
  WeightStorage storage;
  visit(set.layout.with(like.avatar, {weights.data(), size_t(weights.size())}, storage));
}

std::vector<Picture> draw_row(const MemberSet& set, const RowVector& z) {
  std::vector<Picture> pictures;
  visit_row(set, z, [&](const Avatar& avatar) { pictures = set.draw(avatar); });
  return pictures;
}

People draw_rows(const MemberSet& set, const std::string& name, const RowMatrix& z) {
  People pictures(static_cast<size_t>(z.rows()));
  set.crew.run("drawing " + name, pictures.size(),
               [&](size_t i) { pictures[i] = draw_row(set, z.row(static_cast<Eigen::Index>(i))); });
  return pictures;
}

// Their heads and shoulders.
People draw_busts(const MemberSet& set, const std::string& name, const RowMatrix& z) {
  People pictures(static_cast<size_t>(z.rows()));
  set.crew.run("drawing busts of " + name, pictures.size(), [&](size_t i) {
    visit_row(set, z.row(static_cast<Eigen::Index>(i)),
              [&](const Avatar& avatar) { pictures[i] = set.draw_bust(avatar); });
  });
  return pictures;
}

People draw_busts_of(const MemberSet& set, const std::vector<size_t>& members) {
  People pictures(members.size());
  set.crew.run("drawing busts of members", pictures.size(), [&](size_t i) {
    pictures[i] = set.draw_bust(OpenedMember(set.population(), members[i]).avatar);
  });
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
  // Head and shoulders; nobody's where the body has none.
  People training_busts, held_out_busts;
  RowMatrix training_busts_mse, held_out_busts_mse;
  double bust_sharpness = 0;
  // The captures of people whom nobody knows.
  People unseen;
  RowMatrix unseen_mse;

  References(const MemberSet& set, const People& captured, const People& others)
      : training(pictures_of(set, set.training)),
        held_out(pictures_of(set, set.held_out)),
        captures(captured),
        training_mse(errors_within(set, "training members", training)),
        held_out_mse(errors_within(set, "held-out members", held_out)),
        captures_mse(errors_within(set, "captures", captures)),
        training_distances(
            rms_distances(set.training_z, set.training_z, set.standardisation.varying())),
        training_sharpness(sharpness(training)),
        unseen(others),
        unseen_mse(errors_within(set, "unseen people", unseen)) {
    if (!set.has_busts()) return;
    training_busts = draw_busts_of(set, set.training);
    held_out_busts = draw_busts_of(set, set.held_out);
    training_busts_mse = errors_within(set, "training busts", training_busts);
    held_out_busts_mse = errors_within(set, "held-out busts", held_out_busts);
    bust_sharpness = sharpness(training_busts);
  }
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

// Adds "unseen_captures": comparisons with as many of them at a time as there are samples, or with
// all; "groups": how many of these there are, and means over them.
void compare_with_unseen(const MemberSet& set, const References& references,
                         const std::string& name, const People& people, const RowMatrix& within,
                         const BootstrapOptions& bootstrap, nlohmann::json& row) {
  const auto all = static_cast<Eigen::Index>(references.unseen.size());
  if (all < 2) return;
  const Eigen::Index size = std::min<Eigen::Index>(all, within.rows()), groups = all / size;
  const RowMatrix errors = errors_between(set, name + ", unseen", people, references.unseen);
  nlohmann::json means{{"count", groups}};
  for (Eigen::Index g = 0; g < groups; ++g) {
    const nlohmann::json one =
        compare(errors.middleCols(g * size, size), within,
                references.unseen_mse.block(g * size, g * size, size, size), bootstrap);
    if (g == 0) row["unseen_captures"] = one;
    for (const char* key : {"mmd_psnr_db", "coverage_percent", "one_nna_percent"}) {
      means[key] =
          means.value(key, 0.0) + number(one.at(key).at("value")) / static_cast<double>(groups);
    }
  }
  row["unseen_captures"]["groups"] = means;
}

// "bust": the same comparison, copies and sharpness in pictures of head and shoulders.
nlohmann::json judge_busts(const MemberSet& set, const References& references,
                           const std::string& name, const People& busts, Eigen::Index learnt,
                           const BootstrapOptions& bootstrap) {
  const RowMatrix to_training =
      errors_between(set, name + ", training busts", busts, references.training_busts);
  nlohmann::json report{
      {"novelty",
       describe(measure_novelty(to_training.leftCols(learnt),
                                references.training_busts_mse.topLeftCorner(learnt, learnt)))},
      {"highpass_ratio", sharpness(busts) / references.bust_sharpness}};
  if (busts.size() >= references.held_out_busts.size()) {
    report["held_out"] = compare(
        errors_between(set, name + ", held-out busts", busts, references.held_out_busts),
        errors_within(set, name + ", busts", busts), references.held_out_busts_mse, bootstrap);
  }
  return report;
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
  for (size_t s = 0; s < std::min(kNamed, seen.samples.size()); ++s)
    of_pictures["nearest"].push_back(set.name(set.training[seen.samples[s].member]));
  const auto run = [&](size_t count, const std::function<void(size_t)>& piece) {
    set.crew.run("blends", count, piece);
  };
  return {{"novelty", {{"weights", describe(weights)}, {"pictures", of_pictures}}},
          {"blends", describe(measure_blends(z, learnt_z, kMostBlended, run))},
          {"by_part", describe_parts(parts_of(set.standardisation.tokens()), z, learnt_z)},
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
  compare_with_unseen(set, references, generated.name, pictures, within, bootstrap, row);
  if (set.has_busts()) {
    row["bust"] = judge_busts(set, references, generated.name, draw_busts(set, generated.name, z),
                              learnt, bootstrap);
  }
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
  const References references(set, options.captures, options.unseen);
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
  compare_with_unseen(set, references, "held-out members", references.held_out,
                      references.held_out_mse, bootstrap, held_out);
  if (set.has_busts()) {
    held_out["bust"] = judge_busts(set, references, "held-out members", references.held_out_busts,
                                   set.training_z.rows(), bootstrap);
  }
  networks.add_held_out_novelty(held_out);
  // Training members as if they had been sampled: what "within 1 dB of training members" is
  // measured from.
  nlohmann::json members{{"name", "training members"},
                         {"samples", set.training.size()},
                         {"held_out", compare(to_training.transpose(), references.training_mse,
                                              references.held_out_mse, bootstrap)}};
  compare_with_captures(set, references, "training members", references.training,
                        references.training_mse, bootstrap, members);
  compare_with_unseen(set, references, "training members", references.training,
                      references.training_mse, bootstrap, members);
  if (set.has_busts()) {
    members["bust"]["held_out"] = compare(
        errors_between(set, "training busts", references.training_busts, references.held_out_busts),
        references.training_busts_mse, references.held_out_busts_mse, bootstrap);
  }
  networks.add_training_as_samples(members);
  rows.push_back(std::move(members));
  rows.push_back(std::move(held_out));
  nlohmann::json about{{"kind", "renders of trained avatars by the device's renderer, float"},
                       {"training", set.training.size()},
                       {"held_out", set.held_out.size()},
                       {"shots", kComparedShots},
                       {"picture_px", set.picture_px}};
  if (!references.captures.empty()) about["captures"] = describe_captures(references);
  if (!references.unseen.empty()) {
    about["unseen"] = {
        {"kind", "people of the recipe's seed in no part of it, drawn by the captures' renderer"},
        {"people", references.unseen.size()}};
  }
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
