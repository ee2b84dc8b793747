#include "toolchain/generation/networks.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "figurine/check.h"
#include "toolchain/generation/comparison_report.h"
#include "toolchain/generation/novelty.h"
#include "toolchain/measure/frechet.h"
#include "toolchain/measure/kernel_distance.h"
#include "toolchain/measure/sample_metrics.h"

namespace figurine::generation {

using features::ComparingNetworks;
using features::FeatureNetwork;
using measure::bootstrap_interval;
using measure::BootstrapOptions;
using measure::frechet_distance;
using measure::Items;
using measure::KernelComparison;
using measure::RowMatrix;

namespace {

nlohmann::json describe_frechet(const RowMatrix& samples, const RowMatrix& references) {
  const auto pictures = static_cast<size_t>(samples.rows()),
             dimension = static_cast<size_t>(samples.cols());
  if (pictures < kPicturesPerFeature * dimension) {
    return {{"left_out", std::to_string(pictures) + " pictures are too few for " +
                             std::to_string(dimension) + " features"}};
  }
  return {{"value", finite(frechet_distance(samples, references))}};
}

}  // namespace

GenerationNetworks::GenerationNetworks(const ComparingNetworks& networks, const People& training,
                                       const People& held_out, uint32_t threads,
                                       const BootstrapOptions& bootstrap)
    : networks_(networks),
      threads_(threads),
      bootstrap_(bootstrap),
      training_(static_cast<Eigen::Index>(training.size())),
      held_out_(static_cast<Eigen::Index>(held_out.size())),
      pictures_(static_cast<Eigen::Index>(training.at(0).size())),
      references_(training) {
  references_.insert(references_.end(), held_out.begin(), held_out.end());
  for (const auto& network : networks.perceptual) {
    distances_.push_back(measure_distances(*network, references_, {}, threads).within);
  }
  for (const auto& network : networks.features)
    features_.push_back(measure_features(*network, references_, threads));
}

nlohmann::json GenerationNetworks::compare_distances(RowMatrix to_references, RowMatrix samples,
                                                     RowMatrix references) const {
  return describe_draws({std::move(to_references), std::move(samples), std::move(references)},
                        DistanceUnit::kOther, bootstrap_);
}

void GenerationNetworks::compare_features(const FeatureNetwork& network, const RowMatrix& samples,
                                          const RowMatrix& references, nlohmann::json& part) const {
  const KernelComparison comparison(samples, references, static_cast<size_t>(pictures_));
  const Items all = comparison.all();
  part["kid"][network.name()] = to_json(bootstrap_interval(
      all.samples.size(), all.references.size(),
      [&](const Items& items) { return comparison.distance(items); }, bootstrap_));
  part["frechet"][network.name()] = describe_frechet(samples, references);
}

void GenerationNetworks::add_samples(const People& samples, Eigen::Index learnt,
                                     nlohmann::json& row) const {
  const Eigen::Index n = training_, h = held_out_;
  FIG_CHECK(static_cast<Eigen::Index>(samples.size()) >= std::max(n, h),
            "as many samples as either part has members");
  for (size_t i = 0; i < networks_.perceptual.size(); ++i) {
    const std::string& name = networks_.perceptual[i]->name();
    const PeopleDistances own =
        measure_distances(*networks_.perceptual[i], samples, references_, threads_);
    const RowMatrix &to = own.to_references, &within = own.within, &references = distances_[i];
    row["train"]["perceptual"][name] =
        compare_distances(to.leftCols(n), within, references.topLeftCorner(n, n));
    row["held_out"]["perceptual"][name] =
        compare_distances(to.rightCols(h), within, references.bottomRightCorner(h, h));
    row["novelty"]["perceptual"][name] =
        describe(measure_novelty(to.leftCols(learnt), references.topLeftCorner(learnt, learnt)));
  }
  for (size_t i = 0; i < networks_.features.size(); ++i) {
    const FeatureNetwork& network = *networks_.features[i];
    const RowMatrix own = measure_features(network, samples, threads_);
    compare_features(network, own.topRows(n * pictures_), features_[i].topRows(n * pictures_),
                     row["train"]);
    compare_features(network, own.topRows(h * pictures_), features_[i].bottomRows(h * pictures_),
                     row["held_out"]);
  }
}

void GenerationNetworks::add_training_as_samples(nlohmann::json& row) const {
  const Eigen::Index n = training_, h = held_out_;
  for (size_t i = 0; i < networks_.perceptual.size(); ++i) {
    const RowMatrix& all = distances_[i];
    row["held_out"]["perceptual"][networks_.perceptual[i]->name()] = compare_distances(
        all.topRightCorner(n, h), all.topLeftCorner(n, n), all.bottomRightCorner(h, h));
  }
  for (size_t i = 0; i < networks_.features.size(); ++i) {
    compare_features(*networks_.features[i], features_[i].topRows(h * pictures_),
                     features_[i].bottomRows(h * pictures_), row["held_out"]);
  }
}

void GenerationNetworks::add_held_out_novelty(nlohmann::json& row) const {
  const Eigen::Index n = training_, h = held_out_;
  for (size_t i = 0; i < networks_.perceptual.size(); ++i) {
    const RowMatrix& all = distances_[i];
    row["novelty"]["perceptual"][networks_.perceptual[i]->name()] =
        describe(measure_novelty(all.bottomLeftCorner(h, n), all.topLeftCorner(n, n)));
  }
}

}  // namespace figurine::generation
