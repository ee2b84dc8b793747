#include "toolchain/features/retrieval.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "toolchain/error.h"
#include "toolchain/measure/union_error.h"
#include "toolchain/pictures/posed_members.h"
#include "toolchain/random/counter.h"

namespace figurine::features {

using measure::Picture;
using measure::RowMatrix;
using measure::union_error;
using pictures::Crew;
using pictures::members_of;
using pictures::PosedMembers;

namespace {

constexpr uint64_t kNoiseStream = 201;  // and the next
constexpr double kBlurs_px[] = {0.5, 1, 2}, kNoises[] = {0.01, 0.03, 0.1};

// Pictures of some members, [members][shots], and which shots are of other poses and other sides.
struct PictureSet {
  std::vector<std::vector<Picture>> pictures;
  std::vector<std::pair<size_t, size_t>> shot_pairs;  // query, gallery

  // One shot of everybody.
  RgbPictures shot(size_t shot) const {
    std::vector<Picture> all;
    for (const auto& own : pictures) all.push_back(own[shot]);
    return over_grey(all);
  }
  size_t members() const { return pictures.size(); }
  size_t shots() const { return pictures[0].size(); }
};

PictureSet draw_picture_set(const PosedMembers& posed, const std::string& what,
                            const std::vector<size_t>& members) {
  PictureSet set;
  set.pictures.resize(members.size());
  posed.draw(what, members, [&](size_t i, std::vector<Picture> pictures) {
    set.pictures[i] = std::move(pictures);
  });
  for (size_t a = 0; a < posed.shots(); ++a) {
    for (size_t b = 0; b < posed.shots(); ++b) {
      if (posed.pose_of(a) != posed.pose_of(b) && posed.view_of(a) != posed.view_of(b))
        set.shot_pairs.emplace_back(a, b);
    }
  }
  return set;
}

// Share of the queries whose nearest gallery picture shows the same person. distances: [queries,
// gallery], the same people in one order. Ties count against it.
double rank_one(const RowMatrix& distances) {
  size_t found = 0;
  for (Eigen::Index i = 0; i < distances.rows(); ++i) {
    bool nearest = true;
    for (Eigen::Index j = 0; j < distances.cols(); ++j)
      nearest &= j == i || distances(i, i) < distances(i, j);
    found += nearest ? 1 : 0;
  }
  return static_cast<double>(found) / static_cast<double>(distances.rows());
}

// distances(query shot, gallery shot) of everybody to everybody.
using ShotDistances = std::function<RowMatrix(size_t, size_t)>;

double mean_rank_one(const PictureSet& set, const Crew& crew, const std::string& what,
                     const ShotDistances& distances) {
  std::vector<double> found(set.shot_pairs.size());
  crew.run(what, found.size(), [&](size_t i) {
    found[i] = rank_one(distances(set.shot_pairs[i].first, set.shot_pairs[i].second));
  });
  double sum = 0;
  for (const double share : found) sum += share;
  return sum / static_cast<double>(found.size());
}

// [M,M] of pair(i, j).
template <class Pair>
RowMatrix all_pairs(size_t members, Pair&& pair) {
  const auto count = static_cast<Eigen::Index>(members);
  RowMatrix distances(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) distances(i, j) = pair(i, j);
  }
  return distances;
}

double rank_one_of_features(const FeatureNetwork& network, const PictureSet& set, uint32_t threads,
                            const Crew& crew) {
  std::vector<RowMatrix> features;
  for (size_t shot = 0; shot < set.shots(); ++shot)
    features.push_back(network.features(set.shot(shot), threads));
  return mean_rank_one(set, crew, "comparing features", [&](size_t a, size_t b) {
    return all_pairs(set.members(), [&](Eigen::Index i, Eigen::Index j) {
      return (features[a].row(i) - features[b].row(j)).squaredNorm();
    });
  });
}

double rank_one_of_distances(const PerceptualNetwork& network, const PictureSet& set,
                             uint32_t threads, const Crew& crew) {
  std::vector<std::vector<std::vector<float>>> embeddings;
  for (size_t shot = 0; shot < set.shots(); ++shot)
    embeddings.push_back(network.embed(set.shot(shot), threads));
  return mean_rank_one(set, crew, "comparing activations", [&](size_t a, size_t b) {
    return all_pairs(set.members(), [&](Eigen::Index i, Eigen::Index j) {
      return embedding_distance(embeddings[a][static_cast<size_t>(i)],
                                embeddings[b][static_cast<size_t>(j)]);
    });
  });
}

double rank_one_of_pixels(const PictureSet& set, const Crew& crew) {
  return mean_rank_one(set, crew, "comparing pixels", [&](size_t a, size_t b) {
    return all_pairs(set.members(), [&](Eigen::Index i, Eigen::Index j) {
      return union_error(set.pictures[static_cast<size_t>(i)][a],
                         set.pictures[static_cast<size_t>(j)][b])
          .mse();
    });
  });
}

// Mean over pictures of the distance between the i-th of both.
double mean_distance(const PerceptualNetwork& network, const RgbPictures& a, const RgbPictures& b,
                     uint32_t threads) {
  const std::vector<std::vector<float>> x = network.embed(a, threads),
                                        y = network.embed(b, threads);
  double sum = 0;
  for (size_t i = 0; i < x.size(); ++i) sum += embedding_distance(x[i], y[i]);
  return sum / static_cast<double>(x.size());
}

// What a number of the distance means: between people, between poses, and after blur and noise.
nlohmann::json scale_of(const PerceptualNetwork& network, const PictureSet& set,
                        const RetrievalOptions& options) {
  const RgbPictures pictures = set.shot(0);
  const RowMatrix people = network.distances(pictures, pictures, options.threads);
  const double pairs = static_cast<double>(people.rows() * (people.rows() - 1));
  const RgbPictures posed = set.shot(set.shot_pairs.front().second);
  nlohmann::json blur = nlohmann::json::array(), noise = nlohmann::json::array();
  for (const double deviation : kBlurs_px) {
    blur.push_back({{"deviation_px", deviation},
                    {"distance", mean_distance(network, pictures, blurred(pictures, deviation),
                                               options.threads)}});
  }
  for (const double deviation : kNoises) {
    noise.push_back(
        {{"deviation", deviation},
         {"distance", mean_distance(network, pictures, noisy(pictures, deviation, options.seed),
                                    options.threads)}});
  }
  return {{"other_person_same_shot", people.sum() / pairs},
          {"same_person_other_shot", mean_distance(network, pictures, posed, options.threads)},
          {"blur", std::move(blur)},
          {"noise", std::move(noise)}};
}

nlohmann::json measure(const PictureSet& set, const ComparingNetworks& networks,
                       const RetrievalOptions& options) {
  const Crew crew(options.threads, options.quiet);
  nlohmann::json features = nlohmann::json::object(), distance = nlohmann::json::object();
  for (const auto& network : networks.features)
    features[network->name()] = rank_one_of_features(*network, set, options.threads, crew);
  for (const auto& network : networks.perceptual) {
    distance[network->name()] = rank_one_of_distances(*network, set, options.threads, crew);
  }
  return {{"members", set.members()},
          {"queries", set.members() * set.shot_pairs.size()},
          {"chance", 1 / static_cast<double>(set.members())},
          {"pixels", rank_one_of_pixels(set, crew)},
          {"features", std::move(features)},
          {"distance", std::move(distance)}};
}

std::vector<size_t> held_out_members(const Population& population) {
  std::vector<size_t> members = members_of(population, Split::kValidation);
  const std::vector<size_t> test = members_of(population, Split::kTest);
  members.insert(members.end(), test.begin(), test.end());
  return members;
}

// Provenance proves that nobody learnt from whom it is judged by.
void check_not_learnt_from(const nlohmann::json& network, const Package& population,
                           const std::vector<size_t>& held_out) {
  const nlohmann::json provenance = network.value("provenance", nlohmann::json::object());
  if (provenance.value("population_hash", "") != format_hash(population.content_hash())) return;
  const nlohmann::json members =
      nlohmann::json::parse(provenance.value("members", "[]"), nullptr, false);
  std::set<std::string> learnt;
  for (const nlohmann::json& member : members)
    learnt.insert(member.is_string() ? member.get<std::string>() : "");
  for (const size_t member : held_out) {
    const std::string& name = population.population().members[member].name;
    if (learnt.contains(name))
      throw InputError(network.value("file", "") + ": members: learnt from '" + name +
                       "', who is held out");
  }
}

}  // namespace

RgbPictures blurred(const RgbPictures& pictures, double deviation_px) {
  const auto radius = static_cast<int64_t>(std::ceil(3 * deviation_px));
  std::vector<double> kernel;
  double sum = 0;
  for (int64_t i = -radius; i <= radius; ++i) {
    kernel.push_back(std::exp(-0.5 * static_cast<double>(i * i) / (deviation_px * deviation_px)));
    sum += kernel.back();
  }
  RgbPictures out = pictures;
  const int64_t width = pictures.width_px, height = pictures.height_px;
  const auto planes = static_cast<int64_t>(pictures.values.size()) / (width * height);
  // Along rows, then along columns: a line is `count` values `stride` apart.
  const auto pass = [&](float* line, int64_t count, int64_t stride) {
    std::vector<float> copy(static_cast<size_t>(count));
    for (int64_t i = 0; i < count; ++i) copy[static_cast<size_t>(i)] = line[i * stride];
    for (int64_t i = 0; i < count; ++i) {
      double value = 0;
      for (int64_t k = -radius; k <= radius; ++k) {
        value += kernel[static_cast<size_t>(k + radius)] *
                 copy[static_cast<size_t>(std::clamp<int64_t>(i + k, 0, count - 1))];
      }
      line[i * stride] = static_cast<float>(value / sum);
    }
  };
  for (int64_t plane = 0; plane < planes; ++plane) {
    float* values = out.values.data() + plane * width * height;
    for (int64_t y = 0; y < height; ++y) pass(values + y * width, width, 1);
    for (int64_t x = 0; x < width; ++x) pass(values + x, height, width);
  }
  return out;
}

RgbPictures noisy(const RgbPictures& pictures, double deviation, uint64_t seed) {
  RgbPictures out = pictures;
  for (size_t i = 0; i < out.values.size(); ++i) {
    const double noise = deviation * random::random_normal(seed, kNoiseStream, i);
    out.values[i] = static_cast<float>(std::clamp(out.values[i] + noise, 0.0, 1.0));
  }
  return out;
}

nlohmann::json describe_networks(const ComparingNetworks& networks, const Package& population) {
  nlohmann::json described = nlohmann::json::object();
  for (const auto& network : networks.features) described[network->name()] = network->describe();
  for (const auto& network : networks.perceptual) described[network->name()] = network->describe();
  for (const nlohmann::json& network : described)
    check_not_learnt_from(network, population, held_out_members(population.population()));
  return described;
}

nlohmann::json evaluate_networks(const Package& population, const Package& body,
                                 const ComparingNetworks& networks,
                                 const RetrievalOptions& options) {
  const Population& people = population.population();
  const std::vector<size_t> held_out = held_out_members(people);
  std::vector<size_t> training = members_of(people, Split::kTrain);
  if (held_out.size() < 2) {
    throw InputError("population '" + people.name + "': has " + std::to_string(held_out.size()) +
                     " held-out members, at least 2 are needed");
  }
  nlohmann::json described = describe_networks(networks, population);
  const PosedMembers posed(population, body,
                           {.motion = options.motion,
                            .first_pose = options.first_pose,
                            .poses = options.poses,
                            .views = options.views,
                            .seed = options.seed,
                            .threads = options.threads,
                            .quiet = options.quiet});
  training.resize(std::min(training.size(), held_out.size()));
  const PictureSet strangers = draw_picture_set(posed, "drawing held-out members", held_out);
  nlohmann::json scales = nlohmann::json::object();
  for (const auto& network : networks.perceptual)
    scales[network->name()] = scale_of(*network, strangers, options);
  nlohmann::json report{
      {"networks", std::move(described)},
      {"pictures",
       {{"poses", options.poses}, {"views", options.views}, {"size", posed.picture_px()}}},
      {"held_out", measure(strangers, networks, options)},
      {"training",
       measure(draw_picture_set(posed, "drawing training members", training), networks, options)},
      {"scale", std::move(scales)}};
  return report;
}

}  // namespace figurine::features
