#include "toolchain/evaluate/people_distances.h"

#include <algorithm>

#include "figurine/check.h"
#include "toolchain/evaluate/compared_pictures.h"

namespace figurine::evaluate {

namespace {

constexpr Eigen::Index kRows = 16;  // people of a piece of work: a tile's height in PooledErrors

RgbPictures pictures_of_shot(const People& people, size_t shot) {
  std::vector<Picture> pictures;
  for (const std::vector<Picture>& own : people) pictures.push_back(own.at(shot));
  return over_grey(pictures);
}

// [A,E] of one pose and side.
PictureRows embed_shot(const PerceptualNetwork& network, const People& people, size_t shot, uint32_t threads) {
  const std::vector<std::vector<float>> embeddings = network.embed(pictures_of_shot(people, shot), threads);
  PictureRows rows(static_cast<Eigen::Index>(embeddings.size()), embeddings.empty() ? 0 : static_cast<Eigen::Index>(embeddings[0].size()));
  for (size_t i = 0; i < embeddings.size(); ++i) {
    std::copy(embeddings[i].begin(), embeddings[i].end(), rows.row(static_cast<Eigen::Index>(i)).data());
  }
  return rows;
}

// Squared distances of rows [first, first + count) of a to those of b.
RowMatrix distances_of_rows(const PictureRows& a, Eigen::Index first, Eigen::Index count, const PictureRows& b) {
  return pooled_mse(a.middleRows(first, count), b) * static_cast<double>(a.cols());
}

void add_shot(const PictureRows& people, const PictureRows& references, const Crew& crew, PeopleDistances& sums) {
  const auto pieces = static_cast<size_t>((people.rows() + kRows - 1) / kRows);
  crew.run("comparing through a network", pieces, [&](size_t piece) {
    const Eigen::Index first = static_cast<Eigen::Index>(piece) * kRows, count = std::min(kRows, people.rows() - first),
                       left = people.rows() - first;
    if (references.rows() > 0) sums.to_references.middleRows(first, count) += distances_of_rows(people, first, count, references);
    sums.within.block(first, first, count, left) += distances_of_rows(people, first, count, people.bottomRows(left));
  });
}

}  // namespace

PeopleDistances measure_distances(const PerceptualNetwork& network, const People& people, const People& references, const Crew& crew,
                                  uint32_t threads) {
  FIG_CHECK(!people.empty() && !people[0].empty(), "somebody to be compared");
  const size_t shots = people[0].size();
  const auto count = static_cast<Eigen::Index>(people.size());
  PeopleDistances sums{RowMatrix::Zero(count, static_cast<Eigen::Index>(references.size())), RowMatrix::Zero(count, count)};
  for (size_t shot = 0; shot < shots; ++shot) {
    add_shot(embed_shot(network, people, shot, threads), embed_shot(network, references, shot, threads), crew, sums);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) sums.within(i, j) = sums.within(j, i);
  }
  sums.to_references /= static_cast<double>(shots);
  sums.within /= static_cast<double>(shots);
  return sums;
}

RowMatrix measure_features(const FeatureNetwork& network, const People& people, uint32_t threads) {
  FIG_CHECK(!people.empty() && !people[0].empty(), "somebody to be looked at");
  const auto shots = static_cast<Eigen::Index>(people[0].size()), count = static_cast<Eigen::Index>(people.size());
  RowMatrix features(count * shots, static_cast<Eigen::Index>(network.dimension()));
  for (Eigen::Index shot = 0; shot < shots; ++shot) {
    const RowMatrix of_shot = network.features(pictures_of_shot(people, static_cast<size_t>(shot)), threads);
    for (Eigen::Index i = 0; i < count; ++i) features.row(i * shots + shot) = of_shot.row(i);
  }
  return features;
}

}  // namespace figurine::evaluate
