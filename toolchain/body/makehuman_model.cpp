#include "toolchain/body/makehuman_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "figurine/check.h"
#include "toolchain/random/split_mix.h"

namespace figurine::body {
namespace {}  // namespace

MacroShape sample_macro_shape(uint64_t seed) {
  random::SplitMix random(random::mix_bits(seed + random::kWeylStep));
  MacroShape shape;
  const double androgyny = random.uniform(0, 0.3);
  shape.gender = static_cast<float>(random.unit() < 0.5 ? androgyny : 1 - androgyny);
  shape.age_years = static_cast<float>(random.uniform(25, 75));
  shape.muscle = static_cast<float>(random.uniform(0.25, 0.85));
  shape.weight = static_cast<float>(random.uniform(0.2, 0.85));
  // The sculpted extremes are 0.37 m below and 0.72 m above the average: 7 cm are 0.095 of the way
  // down and 0.049 of the way up.
  const double z = std::clamp(random.nearly_normal(), -2.5, 2.5);
  shape.height = static_cast<float>(0.5 + z * (z < 0 ? 0.095 : 0.049));
  // Cubes make mixtures with one clear majority common and pure ones rare.
  for (float* share : {&shape.african, &shape.asian, &shape.caucasian}) {
    const double u = random.unit();
    *share = static_cast<float>(u * u * u);
  }
  return shape;
}

BodyModel make_makehuman_model(const MakeHuman& makehuman, const ShapeBasisOptions& options) {
  FIG_CHECK(options.coefficients >= 1 && options.samples > options.coefficients,
            "principal components need more samples than components");
  const Eigen::Index n = options.samples;
  const Eigen::Index d = Eigen::Index{MakeHuman::kVertexCount} *
                         3;  // helpers too: joints are means of helper vertices
  const Eigen::Index body = Eigen::Index{MakeHuman::kBodyVertexCount} * 3;
  Eigen::MatrixXf people(d, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::vector<float> vertices =
        makehuman.vertices(sample_macro_shape((options.seed << 32) + static_cast<uint64_t>(i)));
    people.col(i) = Eigen::Map<const Eigen::VectorXf>(vertices.data(), d);
  }
  const Eigen::VectorXf mean = people.cast<double>().rowwise().mean().cast<float>();
  people.colwise() -= mean;

  // The Gram matrix is n x n instead of d x d and has the same eigenvalues; distances are measured
  // on the body alone.
  const Eigen::MatrixXf centred = people.topRows(body);
  const Eigen::MatrixXd gram = (centred.transpose() * centred).cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);

  BodyModel model;
  model.name = "makehuman";
  std::vector<float> vertices(mean.data(), mean.data() + d);
  model.surface = makehuman.body_surface(vertices);
  model.joint_m = makehuman.joints(vertices);
  model.shape_count = options.coefficients;
  for (uint32_t s = 0; s < options.coefficients; ++s) {
    const Eigen::Index column = n - 1 - Eigen::Index{s};  // eigenvalues ascend
    // People times a unit eigenvector has length sigma sqrt(n - 1) on the body: divided by sqrt(n -
    // 1) it is one standard deviation.
    Eigen::VectorXf direction =
        people *
        (eigen.eigenvectors().col(column) / std::sqrt(static_cast<double>(n - 1))).cast<float>();
    Eigen::Index largest = 0;
    direction.head(body).cwiseAbs().maxCoeff(&largest);
    if (direction[largest] < 0) direction = -direction;  // an eigenvector's sign is free: fix it
    model.vertex_shape_basis_m.insert(model.vertex_shape_basis_m.end(), direction.data(),
                                      direction.data() + body);
    const std::vector<float> row(direction.data(), direction.data() + d);
    const JointPositions joints = makehuman.joints(row);
    model.joint_shape_basis_m.insert(model.joint_shape_basis_m.end(), joints.begin(), joints.end());
  }

  model.provenance.sources = {MakeHuman::source_line()};
  model.provenance.settings = {
      {"shape_basis", "principal components of " + std::to_string(options.samples) +
                          " adults, seed " + std::to_string(options.seed)}};
  model.provenance.licence_name = "CC0-1.0";
  model.provenance.licence_url = "https://creativecommons.org/publicdomain/zero/1.0/";
  model.provenance.authors = {"The MakeHuman team (data)", "figurine (texel body)"};
  model.provenance.avatar_permission = "everyone";
  model.provenance.commercial_usage = "corporation";
  model.provenance.depicted_person = "synthetic";
  return model;
}

}  // namespace figurine::body
