#include "formats/writer/population_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "formats/writer/package_parts.h"
#include "formats/writer/package_writer.h"
#include "formats/writer/rans_encoder.h"
#include "formats/writer/static_codes.h"

namespace figurine {

namespace {

Status mismatch(const NewMember& member, const std::string& what) {
  return Status(StatusCode::kMismatch, "member '" + member.avatar->name + "': " + what);
}

bool same_shape(const Network& a, const Network& b) {
  const auto same = [](const Layer& x, const Layer& y) {
    return x.op == y.op && x.inputs[0] == y.inputs[0] && x.inputs[1] == y.inputs[1] &&
           x.out_channels == y.out_channels && x.kernel == y.kernel && x.relu == y.relu;
  };
  return a.input_size == b.input_size && a.input_channels == b.input_channels &&
         std::ranges::equal(a.layers, b.layers, same);
}

bool same_weights(const Network& a, const Network& b) {
  return std::ranges::equal(a.layers, b.layers, [](const Layer& x, const Layer& y) {
    return std::ranges::equal(x.weights, y.weights) && std::ranges::equal(x.bias, y.bias);
  });
}

// Whatever a member without a network states, it is the shared network that learnt poses.
const PoseStatistics& statistics_of(const NewMember& member, const NewPopulation& population) {
  const bool own = population.shared == nullptr || member.avatar->has_network();
  return (own ? *member.avatar : *population.shared).pose_statistics;
}

// Person and pose, whatever the network.
Status check_person_alike(const NewMember& member, const NewPopulation& population) {
  const Avatar &own = *member.avatar, &first = *population.members.front().avatar;
  const std::string of_first = ", '" + first.name + "' has ";
  if (own.shape.size() != first.shape.size()) {
    return mismatch(member, "has " + std::to_string(own.shape.size()) + " shape coefficients" +
                                of_first + std::to_string(first.shape.size()));
  }
  if (statistics_of(member, population).joints !=
      statistics_of(population.members.front(), population).joints) {
    return mismatch(member,
                    "its pose statistics list other joints than those of '" + first.name + "'");
  }
  if (own.golden.rotations.size() != first.golden.rotations.size()) {
    return mismatch(member, "its golden pose has " +
                                std::to_string(own.golden.rotations.size() / 4) + " joints" +
                                of_first + std::to_string(first.golden.rotations.size() / 4));
  }
  return {};
}

Status check_alike(const NewMember& member, const NewPopulation& population) {
  const bool alike = population.coding == DifferenceCoding::kNone;  // in their networks
  const Avatar &own = *member.avatar,
               &first = alike ? *population.shared : *population.members.front().avatar;
  const std::string of_first = ", '" + first.name + "' has ";
  if (!same_groups(own.static_part, first.static_part))
    return mismatch(member, "its static part has other groups than that of '" + first.name + "'");
  if (!own.smallest_extents.empty())
    return mismatch(member, "has smallest extents: a population does not hold them");
  if (own.has_network() && !own.holds(Precision::kFloat32))
    return mismatch(member, "holds no float weights (figurine-train pack --precision f32)");
  if (own.body_hash != first.body_hash) {
    return mismatch(member, "was made for the body '" + own.body_name + "' " +
                                format_hash(own.body_hash) + of_first + "'" + first.body_name +
                                "' " + format_hash(first.body_hash));
  }
  if (own.template_mode != first.template_mode)
    return mismatch(member, "has its Gaussians on another template than '" + first.name + "'");
  const bool drawn_alike =
      own.antialiased == first.antialiased && own.texels_a_side() == first.texels_a_side();
  const Status otherwise = mismatch(member, "is drawn otherwise than '" + first.name +
                                                "': antialiased, or for another number of texels");
  if (alike && !own.has_network())
    return drawn_alike ? check_person_alike(member, population) : otherwise;
  if (!same_shape(own.network, population.initial)) {
    return mismatch(member, "its network has another shape than the initial weights (" +
                                std::to_string(count_parameters(own.network)) +
                                " parameters, not " +
                                std::to_string(count_parameters(population.initial)) + ")");
  }
  if (!drawn_alike) return otherwise;
  if (alike && !same_weights(own.network, population.initial))
    return mismatch(member, "its network has other weights than that of '" + first.name + "'");
  if (own.fourier_octaves != first.fourier_octaves) {
    return mismatch(member, "has " + std::to_string(own.fourier_octaves) + " Fourier octaves" +
                                of_first + std::to_string(first.fourier_octaves));
  }
  return check_person_alike(member, population);
}

// The arrays behind a Population's spans.
struct Storage {
  std::optional<MeanStaticPart> mean;  // where nobody's is given
  StaticCodes statics;
  std::vector<float> shape, bias, scale, pose_mean, golden_poses;
  std::vector<int16_t> frequency;
  std::vector<uint8_t> code;
  std::vector<uint32_t> code_end;
  std::vector<Half> difference, pose_factor;
};

template <class T>
void append(std::vector<T>& to, std::span<const T> values) {
  to.insert(to.end(), values.begin(), values.end());
}

// Differences of one output channel in integers, the largest as `levels`; returns the scale.
float quantise_row(std::span<const float> weights, std::span<const float> initial, uint32_t levels,
                   std::vector<int8_t>& out) {
  float largest = 0;
  for (size_t k = 0; k < weights.size(); ++k)
    largest = std::max(largest, std::fabs(weights[k] - initial[k]));
  const float most = static_cast<float>(levels),
              scale = std::max(largest / most, std::numeric_limits<float>::min());
  for (size_t k = 0; k < weights.size(); ++k) {
    out.push_back(
        static_cast<int8_t>(clamp_and_round((weights[k] - initial[k]) / scale, -most, most)));
  }
  return scale;
}

// [C] of one member's integers, in the order of the convolutions.
using Kernels = std::vector<std::vector<int8_t>>;

Kernels quantise(const Avatar& avatar, const Network& initial, uint32_t levels,
                 std::vector<float>& scales) {
  Kernels kernels;
  for (size_t i = 0; i < initial.layers.size(); ++i) {
    if (initial.layers[i].op != LayerOp::kConv2d) continue;
    const std::span<const float> weights = avatar.network.layers[i].weights,
                                 start = initial.layers[i].weights;
    const size_t rows = initial.layers[i].out_channels, row = weights.size() / rows;
    std::vector<int8_t>& kernel = kernels.emplace_back();
    for (size_t o = 0; o < rows; ++o) {
      scales.push_back(
          quantise_row(weights.subspan(o * row, row), start.subspan(o * row, row), levels, kernel));
    }
  }
  return kernels;
}

// Streams of all members, over one table of frequencies for each convolution.
Status encode(const std::vector<Kernels>& members, Storage& storage) {
  std::vector<RansTable> tables;
  for (size_t c = 0; c < members.front().size(); ++c) {
    std::array<uint64_t, kRansValues> counts{};
    for (const Kernels& member : members) {
      for (const int8_t q : member[c]) ++counts[static_cast<size_t>(q + 127)];
    }
    const std::array<int16_t, kRansValues> frequency = normalise_counts(counts);
    append(storage.frequency, std::span<const int16_t>(frequency));
    tables.emplace_back(frequency);
  }
  for (const Kernels& member : members) {
    std::vector<RansStretch> stretches;
    for (size_t c = 0; c < member.size(); ++c) stretches.push_back({member[c], &tables[c]});
    append(storage.code, std::span<const uint8_t>(encode_rans(stretches)));
    if (storage.code.size() > std::numeric_limits<uint32_t>::max()) {
      return Status(StatusCode::kLimitExceeded, "population: its streams are longer than 4 GiB");
    }
    storage.code_end.push_back(static_cast<uint32_t>(storage.code.size()));
  }
  return {};
}

Status add_halves(const NewMember& member, const Network& initial, std::vector<Half>& out) {
  for (size_t i = 0; i < initial.layers.size(); ++i) {
    for (size_t k = 0; k < initial.layers[i].weights.size(); ++k) {
      out.push_back(
          to_half(member.avatar->network.layers[i].weights[k] - initial.layers[i].weights[k]));
      if (is_finite(out.back())) continue;
      return Status(StatusCode::kLimitExceeded, "member '" + member.avatar->name + "': layer " +
                                                    std::to_string(i) +
                                                    ": a difference is too large for 16 bits");
    }
  }
  return {};
}

// The lower triangle L of a positive definite matrix = L L^T (Cholesky), rows one after the other,
// rounded to halves.
void add_factor(std::span<const float> matrix, size_t n, std::vector<Half>& out) {
  std::vector<double> lower(n * n, 0.0);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      double sum = matrix[i * n + j];
      for (size_t k = 0; k < j; ++k) sum -= lower[i * n + k] * lower[j * n + k];
      lower[i * n + j] = i == j ? std::sqrt(sum) : sum / lower[j * n + j];
      out.push_back(to_half(static_cast<float>(lower[i * n + j])));
    }
  }
}

// The members' maps against the shared one, or against their mean.
Status take_static_parts(const NewPopulation& from, Storage& storage, Population& to) {
  std::vector<const StaticPart*> parts;
  for (const NewMember& member : from.members) parts.push_back(&member.avatar->static_part);
  if (parts.front()->empty()) return {};
  if (from.shared == nullptr) storage.mean.emplace(parts);
  to.static_part = storage.mean ? storage.mean->view() : from.shared->static_part;
  Result<StaticCodes> codes = encode_static_parts(to.static_part, parts);
  if (!codes.ok()) return codes.status();
  storage.statics = std::move(codes).value();
  to.static_scale = storage.statics.scale;
  to.static_frequency = storage.statics.frequency;
  to.static_code = storage.statics.code;
  to.static_code_end = storage.statics.code_end;
  return {};
}

// ---- Provenance: what all members have is said once ---------------------------------------------

// Removes from every member what all have, and returns that.
Provenance factor_out(std::vector<Provenance>& own) {
  Provenance shared;
  const auto all = [&](const auto& member_has) {
    return std::all_of(own.begin(), own.end(), member_has);
  };
  for (std::string Provenance::* text : kProvenanceTexts) {
    const std::string common = own.front().*text;
    if (!all([&](const Provenance& member) { return member.*text == common; })) continue;
    shared.*text = common;
    for (Provenance& member : own) (member.*text).clear();
  }
  const auto factor_list = [&](auto list, const auto& same) {
    for (const auto& entry : std::vector(own.front().*list)) {
      const auto is_it = [&](const auto& other) { return same(entry, other); };
      if (!all([&](const Provenance& member) { return std::ranges::any_of(member.*list, is_it); }))
        continue;
      (shared.*list).push_back(entry);
      for (Provenance& member : own) std::erase_if(member.*list, is_it);
    }
  };
  factor_list(&Provenance::settings, [](const KeyValue& a, const KeyValue& b) {
    return a.key == b.key && a.value == b.value;
  });
  factor_list(&Provenance::sources,
              [](const std::string& a, const std::string& b) { return a == b; });
  const std::vector<std::string> authors = own.front().authors;
  if (all([&](const Provenance& member) { return member.authors == authors; })) {
    shared.authors = authors;
    for (Provenance& member : own) member.authors.clear();
  }
  return shared;
}

// Names in the order in which they first come, and each member's figures under them.
void take_quality(const NewPopulation& from, Population& to) {
  for (const NewMember& member : from.members) {
    for (const QualityMetric& metric : member.provenance->quality) {
      if (std::ranges::find(to.quality_names, metric.name) == to.quality_names.end())
        to.quality_names.push_back(metric.name);
    }
  }
  for (size_t m = 0; m < from.members.size(); ++m) {
    to.members[m].quality.assign(to.quality_names.size(), std::numeric_limits<double>::quiet_NaN());
    for (const QualityMetric& metric : from.members[m].provenance->quality) {
      const auto name = std::ranges::find(to.quality_names, metric.name);
      to.members[m].quality[static_cast<size_t>(name - to.quality_names.begin())] = metric.value;
    }
  }
}

Status check(const NewPopulation& population) {
  if (population.members.empty())
    return Status(StatusCode::kInvalidArgument, "population: has no members");
  if (population.members.size() > kMaxMembers) {
    return Status(StatusCode::kLimitExceeded,
                  "population: has more than " + std::to_string(kMaxMembers) + " members");
  }
  if (population.levels < 1 || population.levels > kMostLevels) {
    return Status(
        StatusCode::kInvalidArgument,
        "population: levels " + std::to_string(population.levels) + " are none of 1 to 127");
  }
  if ((population.coding == DifferenceCoding::kNone) != (population.shared != nullptr)) {
    return Status(StatusCode::kInvalidArgument,
                  "population: a shared avatar goes with members of one network");
  }
  const Result<std::vector<ValueShape>> shapes = infer_shapes(population.initial, true);
  if (!shapes.ok())
    return Status(StatusCode::kInvalidArgument, "initial weights: " + shapes.status().message());
  for (const NewMember& member : population.members)
    FIG_RETURN_IF_ERROR(check_alike(member, population));
  return {};
}

}  // namespace

Result<std::vector<std::byte>> write_population(const NewPopulation& from) {
  FIG_RETURN_IF_ERROR(check(from));
  const Avatar& first = *from.members.front().avatar;
  Population to;
  to.kind() = (from.shared != nullptr ? *from.shared : first).kind();
  to.uv_size = first.texels_a_side();
  to.antialiased = first.antialiased;
  to.name = from.name;
  to.network = from.initial;
  to.coding = from.coding;
  to.pose_joints = statistics_of(from.members.front(), from).joints;
  Storage storage;
  std::vector<Kernels> kernels;
  std::vector<Provenance> own;
  for (const NewMember& member : from.members) {
    const Avatar& avatar = *member.avatar;
    PopulationMember& described = to.members.emplace_back();
    described.traits() = avatar.traits();
    if (from.shared != nullptr) described.map_statistics = from.shared->map_statistics;
    described.golden = avatar.golden.without_picture();
    described.name = avatar.name;
    described.split = member.split;
    append(storage.shape, avatar.shape);
    const PoseStatistics& poses = statistics_of(member, from);
    append(storage.pose_mean, poses.mean);
    append(storage.golden_poses, avatar.golden.rotations);
    add_factor(poses.covariance, 3 * to.pose_joints.size(), storage.pose_factor);
    if (from.coding != DifferenceCoding::kNone) {
      for (const Layer& layer : avatar.network.layers) append(storage.bias, layer.bias);
    }
    if (from.coding == DifferenceCoding::kInt8) {
      kernels.push_back(quantise(avatar, from.initial, from.levels, storage.scale));
    } else if (from.coding == DifferenceCoding::kHalf) {
      FIG_RETURN_IF_ERROR(add_halves(member, from.initial, storage.difference));
    }
    own.push_back(*member.provenance);
    if (from.progress && !from.progress(to.size()))
      return Status(StatusCode::kInterrupted, "population: interrupted, nothing was written");
  }
  if (from.coding == DifferenceCoding::kInt8) FIG_RETURN_IF_ERROR(encode(kernels, storage));
  FIG_RETURN_IF_ERROR(take_static_parts(from, storage, to));
  take_quality(from, to);
  Provenance shared = factor_out(own);
  shared.settings.insert(shared.settings.end(), from.settings.begin(), from.settings.end());
  to.shape = storage.shape;
  to.bias = storage.bias;
  to.scale = storage.scale;
  to.frequency = storage.frequency;
  to.code = storage.code;
  to.code_end = storage.code_end;
  to.difference = storage.difference;
  to.pose_mean = storage.pose_mean;
  to.pose_factor = storage.pose_factor;
  to.golden_poses = storage.golden_poses;
  return write_package(to, from.budget, shared, own);
}

}  // namespace figurine
