#include "toolchain/generate/quantised_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "figurine/detail/fixed_point_weights.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/opened_member.h"

namespace figurine::generate {

namespace {

// Appends a row's integers and returns their scale: the largest at 127. A row of zeros gets a scale
// of 1.
template <class Row>
float append_row(const Row& row, size_t count, std::vector<int8_t>& out) {
  double largest = 0;
  for (size_t k = 0; k < count; ++k)
    largest = std::max(largest, std::abs(double(row[static_cast<Eigen::Index>(k)])));
  const auto scale = largest > 1e-30 ? static_cast<float>(largest / kWeightMax) : 1.0f;
  for (size_t k = 0; k < count; ++k) {
    const double steps = std::nearbyint(double(row[static_cast<Eigen::Index>(k)]) / double{scale});
    out.push_back(static_cast<int8_t>(std::clamp<double>(steps, -kWeightMax, kWeightMax)));
  }
  return scale;
}

bool same(const MapStatistics& a, const MapStatistics& b) {
  return a.mean == b.mean && a.scale == b.scale;
}
bool same(const HeadDecoding& a, const HeadDecoding& b) {
  return a.offset_scale_m == b.offset_scale_m && a.spacing_scale == b.spacing_scale &&
         a.max_log_scale == b.max_log_scale && a.opacity_bias == b.opacity_bias &&
         a.sh_degree == b.sh_degree && a.max_offset == b.max_offset;
}

}  // namespace

void pooled_pose_statistics(const Population& population, std::vector<float>& mean,
                            std::vector<float>& covariance) {
  const size_t size = 3 * population.pose_joints.size();
  Eigen::VectorXd first = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size));
  Eigen::MatrixXd second = Eigen::MatrixXd::Zero(first.size(), first.size());
  std::vector<float> own(size * size);
  double members = 0;
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split != Split::kTrain) continue;
    const Eigen::VectorXd centre =
        Eigen::Map<const Eigen::VectorXf>(population.pose_mean.data() + m * size, first.size())
            .cast<double>();
    pose_covariance(population, m, own);
    first += centre;
    second +=
        Eigen::Map<const Eigen::MatrixXf>(own.data(), first.size(), first.size()).cast<double>() +
        centre * centre.transpose();
    ++members;
  }
  first /= members;
  const Eigen::MatrixXd total = second / members - first * first.transpose();
  mean.resize(size), covariance.resize(size * size);
  Eigen::Map<Eigen::VectorXf>(mean.data(), first.size()) = first.cast<float>();
  Eigen::Map<Eigen::MatrixXf>(covariance.data(), first.size(), first.size()) =
      (0.5 * (total + total.transpose())).cast<float>();
}

QuantisedSampler::QuantisedSampler(const TrainedSampler& trained, std::vector<Quantisation> ranges,
                                   const std::string& name) {
  if (trained.settings.space.variant != Variant::kBasis) {
    throw InputError(std::string("sampler: variant ") + to_string(trained.settings.space.variant) +
                     " has no package; basis has");
  }
  if (trained.settings.shape.prediction != Prediction::kClean) {
    throw InputError(std::string("sampler: prediction ") +
                     to_string(trained.settings.shape.prediction) +
                     " has no package: devices know clean values");
  }
  const Population& population = trained.population->package.population();
  sampler_.name = name;
  sampler_.population_hash = trained.population->package.content_hash();
  sampler_.values = std::move(ranges);
  take_what_members_share(population);
  take_network(population);
  take_static_groups(trained, population);
  quantise_space(trained);
  quantise_transformer(trained);
  sampler_.noise = {.dimension = trained.space->dimension(),
                    .noisy_dimension_snr = trained.settings.noisy_dimension_snr,
                    .clean_snr = trained.settings.clean_snr};
}

void QuantisedSampler::take_what_members_share(const Population& population) {
  const PopulationMember* first = nullptr;
  for (const PopulationMember& member : population.members) {
    if (member.split != Split::kTrain) continue;
    if (first == nullptr) first = &member;
    if (!same(member.map_statistics, first->map_statistics) ||
        !same(member.decoding, first->decoding)) {
      throw InputError("population '" + population.name + "': member '" + member.name +
                       "' has other maps or another decoding than '" + first->name +
                       "'; a sampler needs one for all");
    }
  }
  sampler_.kind() = population.kind();
  sampler_.uv_size = population.uv_size;
  sampler_.antialiased = population.antialiased;
  sampler_.shape_count = static_cast<uint32_t>(population.shape.size() / population.size());
  sampler_.traits() = first->traits();  // a member's golden frame has no picture
  if (population.pose_joints.empty()) return;
  pooled_pose_statistics(population, pose_mean_, pose_covariance_);
  sampler_.pose_statistics = {population.pose_joints, pose_mean_, pose_covariance_, {}};
}

// Everybody's network goes with the sampler, in floats and by the ranges in fixed point.
void QuantisedSampler::take_network(const Population& population) {
  sampler_.shares_network = population.coding == DifferenceCoding::kNone;
  if (!sampler_.shares_network) {
    for (Layer& layer : sampler_.network.layers) layer.weights = layer.bias = {};
    return;
  }
  throw_if_error(fixed_point_.quantise(population.network, sampler_.values),
                 "population '" + population.name + "'");
  sampler_.fixed_point = fixed_point_.view();
}

// A channel's integers reach as far as the farthest training member.
void QuantisedSampler::take_static_groups(const TrainedSampler& trained,
                                          const Population& population) {
  const std::vector<StaticGroup>& groups = population.static_part.groups;
  for (const StaticGroup& group : groups)
    static_scale_.emplace_back(group.channels, std::numeric_limits<float>::min());
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split != Split::kTrain) continue;
    const train::OpenedMember member(population, m);
    for (size_t g = 0; g < groups.size(); ++g) {
      const StaticGroup& own = member.avatar.static_part.groups[g];
      for (size_t i = 0; i < own.values.size(); ++i) {
        const size_t c = i % own.channels;
        const float value = std::abs(own.scale[c] * static_cast<float>(own.values[i]));
        static_scale_[g][c] = std::max(static_scale_[g][c], value / 127);
      }
    }
  }
  for (size_t g = 0; g < groups.size(); ++g) {
    const measure::WeightLayout::Patches& patches = trained.layout->patches()[g];
    static_row_.push_back(patches.row);
    sampler_.static_groups.push_back({.first_channel = groups[g].first_channel,
                                      .channels = groups[g].channels,
                                      .grid_size = groups[g].grid_size,
                                      .scale = static_scale_[g],
                                      .row = {},
                                      .patch_rows = patches.patch_rows});
  }
  for (size_t g = 0; g < groups.size(); ++g) sampler_.static_groups[g].row = static_row_[g];
}

void QuantisedSampler::quantise_space(const TrainedSampler& trained) {
  const ModelSpace& space = *trained.space;
  const measure::Standardisation& standardisation = space.standardisation();
  for (Eigen::Index j = 0; j < standardisation.mean().size(); ++j)
    mean_.push_back(static_cast<float>(standardisation.mean()[j]));
  for (size_t l = 0; l < space.token_sizes().size(); ++l) {
    const measure::RowMatrix& directions = space.directions(l);
    sampler_.ranks.push_back(static_cast<uint32_t>(directions.rows()));
    // A direction's entry of a value that does not vary is zero: the value stays at its mean, as
    // restore() has it.
    const double factor = standardisation.scale(l) * space.coordinate_scale(l);
    for (Eigen::Index k = 0; k < directions.rows(); ++k) {
      const float scale =
          append_row(directions.row(k), static_cast<size_t>(directions.cols()), directions_);
      direction_scale_.push_back(static_cast<float>(double{scale} * factor));
    }
  }
  sampler_.mean = mean_, sampler_.directions = directions_,
  sampler_.direction_scale = direction_scale_;
}

void QuantisedSampler::quantise_transformer(const TrainedSampler& trained) {
  Transformer& transformer = *trained.transformer;
  const TransformerShape& shape = transformer.shape();
  sampler_.denoiser = {.d_model = static_cast<uint32_t>(shape.d_model),
                       .blocks = static_cast<uint32_t>(shape.blocks),
                       .heads = static_cast<uint32_t>(shape.heads),
                       .feed_forward = static_cast<uint32_t>(shape.feed_forward)};
  const torch::Tensor flat = transformer.weights().detach().contiguous();
  const float* weights = flat.const_data_ptr<float>();
  const auto end_of = [](const std::string& name, const char* end) { return name.ends_with(end); };
  // The trainer's list has the package's order: projections, position, time, blocks, last norm,
  // projections back.
  for (const FlatParameter& parameter : transformer.layout().list()) {
    const float* from = weights + parameter.begin;
    const int64_t size = parameter.count();
    if (parameter.name == "position") {
      position_.assign(from, from + size);
    } else if (parameter.name.find("norm") != std::string::npos) {
      norm_.insert(norm_.end(), from, from + size);
    } else if (end_of(parameter.name, ".bias")) {
      bias_.insert(bias_.end(), from, from + size);
    } else {
      const auto columns = static_cast<size_t>(parameter.shape[1]);
      for (int64_t row = 0; row < parameter.shape[0]; ++row) {
        row_scale_.push_back(append_row(from + row * parameter.shape[1], columns, matrices_));
      }
    }
  }
  sampler_.matrices = matrices_, sampler_.row_scale = row_scale_, sampler_.bias = bias_;
  sampler_.position = position_, sampler_.norm = norm_;
}

}  // namespace figurine::generate
