#include "toolchain/members/mixtures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "toolchain/json_number.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::foreground_error;
using measure::high_pass;
using measure::Picture;
using measure::RowMatrix;
using measure::RowVector;
using measure::union_error;
using measure::WeightLayout;
using measure::WeightStorage;
using train::OpenedMember;

namespace {

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

}  // namespace

Mixture measure_mixture(const MemberSet& set, const Avatar& mixed) {
  RowMatrix weights(1, set.training_z.cols());
  set.layout.read(mixed, {weights.data(), size_t(weights.size())});
  const RowVector z = set.standardisation.standardise(std::move(weights)).row(0);
  const std::vector<Picture> pictures = set.draw(mixed);
  Mixture mixture{.energy = high_pass_energy(pictures), .foreground = foreground_pixels(pictures)};
  Eigen::Index row = 0;
  const double squares = (set.training_z.rowwise() - z).rowwise().squaredNorm().minCoeff(&row);
  mixture.weights_member = set.name(set.training[size_t(row)]);
  mixture.weights_rms = std::sqrt(squares / static_cast<double>(set.standardisation.varying()));
  mixture.picture_db = -std::numeric_limits<double>::infinity();
  for (const size_t member : set.training) {
    const double psnr_db = union_error(pictures, set.pictures[member]).psnr_db();
    if (psnr_db <= mixture.picture_db) continue;
    mixture.picture_db = psnr_db;
    mixture.picture_member = set.name(member);
  }
  return mixture;
}

nlohmann::json Mixture::describe(const Mixture& a, const Mixture& b) const {
  return {{"highpass_ratio", finite(2 * energy / (a.energy + b.energy))},
          {"foreground_ratio", finite(2 * foreground / (a.foreground + b.foreground))},
          {"nearest",
           {{"weights", {{"member", weights_member}, {"rms", weights_rms}}},
            {"pictures", {{"member", picture_member}, {"psnr_db", finite(picture_db)}}}}}};
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
    const MixedPair& pair = pairs[i / kSteps];
    const OpenedMember a(set.population(), pair.a), b(set.population(), pair.b);
    WeightStorage storage;
    mixtures[i] =
        measure_mixture(set, mix(set.layout, a.avatar, b.avatar, kMixSteps[i % kSteps], storage));
  });
  nlohmann::json report{{"steps", kMixSteps}, {"pairs", nlohmann::json::array()}};
  for (size_t p = 0; p < pairs.size(); ++p) {
    const Mixture *own = &mixtures[p * kSteps], &first = own[0], &last = own[kSteps - 1];
    nlohmann::json row{
        {"a", set.name(pairs[p].a)}, {"b", set.name(pairs[p].b)}, {"why", pairs[p].why}};
    for (size_t i = 0; i < kSteps; ++i) {
      nlohmann::json step{{"share", kMixSteps[i]}};
      step.update(own[i].describe(first, last));
      row["steps"].push_back(std::move(step));
    }
    row["middle_highpass_ratio"] = row["steps"][kSteps / 2]["highpass_ratio"];
    report["pairs"].push_back(std::move(row));
  }
  return report;
}

}  // namespace figurine::members
