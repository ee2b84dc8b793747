#include "toolchain/generation/people_distances.h"

#include <algorithm>

#include "figurine/check.h"
#include "toolchain/measure/pooled_errors.h"
#include "toolchain/tensor_operations.h"

namespace figurine::generation {

using features::FeatureNetwork;
using features::over_grey;
using features::PerceptualNetwork;
using features::RgbPictures;
using measure::Picture;
using measure::PictureRows;
using measure::RowMatrix;

namespace {

constexpr Eigen::Index kRows = 16;  // people of a piece of work: a tile's height in PooledErrors

RgbPictures pictures_of_shot(const People& people, size_t shot) {
  std::vector<Picture> pictures;
  for (const std::vector<Picture>& own : people) pictures.push_back(own.at(shot));
  return over_grey(pictures);
}

// [A,E] of one pose and side.
PictureRows embed_shot(const PerceptualNetwork& network, const People& people, size_t shot,
                       uint32_t threads) {
  const std::vector<std::vector<float>> embeddings =
      network.embed(pictures_of_shot(people, shot), threads);
  PictureRows rows(static_cast<Eigen::Index>(embeddings.size()),
                   embeddings.empty() ? 0 : static_cast<Eigen::Index>(embeddings[0].size()));
  for (size_t i = 0; i < embeddings.size(); ++i) {
    std::copy(embeddings[i].begin(), embeddings[i].end(),
              rows.row(static_cast<Eigen::Index>(i)).data());
  }
  return rows;
}

// What is left of |a|^2 + |b|^2 - 2 a b by rounding where a and b are equal.
constexpr double kRounding = 1e-12;
constexpr Eigen::Index kValuesAtOnce = 4096;  // of an embedding: what is held in double

torch::Tensor doubles_of(const PictureRows& rows, Eigen::Index first, Eigen::Index count) {
  const torch::Tensor out = torch::empty({rows.rows(), count}, torch::kFloat64);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    std::copy_n(&rows(i, first), count, out.data_ptr<double>() + i * count);
  }
  return out;
}

// Squared distances of all rows of a to all of b, in double: a matrix product, since there are many
// more pairs than pictures. [A,B]
RowMatrix squared_distances(const PictureRows& a, const PictureRows& b) {
  const torch::NoGradGuard no_gradient;
  torch::Tensor products = torch::zeros({a.rows(), b.rows()}, torch::kFloat64);
  torch::Tensor of_a = torch::zeros({a.rows(), 1}, torch::kFloat64),
                of_b = torch::zeros({1, b.rows()}, torch::kFloat64);
  for (Eigen::Index first = 0; first < a.cols(); first += kValuesAtOnce) {
    const Eigen::Index count = std::min(kValuesAtOnce, a.cols() - first);
    const torch::Tensor x = doubles_of(a, first, count),
                        y = &a == &b ? x : doubles_of(b, first, count);
    products.addmm_(x, y.t());
    of_a += x.square().sum(1, true), of_b += y.square().sum(1).unsqueeze(0);
  }
  const torch::Tensor sizes = of_a + of_b;
  torch::Tensor squared = sizes - 2 * products;
  squared =
      torch::where(squared < kRounding * sizes, torch::zeros_like(squared), squared).contiguous();
  return Eigen::Map<const RowMatrix>(squared.data_ptr<double>(), a.rows(), b.rows());
}

}  // namespace

PeopleDistances measure_distances(const PerceptualNetwork& network, const People& people,
                                  const People& references, uint32_t threads) {
  FIG_CHECK(!people.empty() && !people[0].empty(), "somebody to be compared");
  const size_t shots = people[0].size();
  const auto count = static_cast<Eigen::Index>(people.size());
  PeopleDistances sums{RowMatrix::Zero(count, static_cast<Eigen::Index>(references.size())),
                       RowMatrix::Zero(count, count)};
  for (size_t shot = 0; shot < shots; ++shot) {
    const PictureRows own = embed_shot(network, people, shot, threads);
    sums.within += squared_distances(own, own);
    if (!references.empty())
      sums.to_references += squared_distances(own, embed_shot(network, references, shot, threads));
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
  const auto shots = static_cast<Eigen::Index>(people[0].size()),
             count = static_cast<Eigen::Index>(people.size());
  RowMatrix features(count * shots, static_cast<Eigen::Index>(network.dimension()));
  for (Eigen::Index shot = 0; shot < shots; ++shot) {
    const RowMatrix of_shot =
        network.features(pictures_of_shot(people, static_cast<size_t>(shot)), threads);
    for (Eigen::Index i = 0; i < count; ++i) features.row(i * shots + shot) = of_shot.row(i);
  }
  return features;
}

}  // namespace figurine::generation
