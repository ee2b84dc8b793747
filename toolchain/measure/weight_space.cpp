#include "toolchain/measure/weight_space.h"

#include <algorithm>
#include <cmath>

#include "figurine/check.h"

namespace figurine::measure {

namespace {

constexpr double kRounding =
    1e-10;  // of the largest variance: a Gram matrix of a few hundred rows in double leaves 1e-14

size_t vector_size(const std::vector<Token>& tokens) {
  return tokens.empty() ? 0 : tokens.back().begin + tokens.back().size;
}

// All members' values of a stretch agree in column d.
bool is_shared(const RowMatrix& training, Eigen::Index d) {
  for (Eigen::Index n = 1; n < training.rows(); ++n) {
    if (training(n, d) != training(0, d)) return false;
  }
  return true;
}

}  // namespace

std::vector<Token> weight_tokens(const Network& network, size_t shape_coefficients) {
  std::vector<Token> tokens;
  size_t begin = 0;
  const auto add = [&](const std::string& name, size_t size) {
    tokens.push_back({name, begin, size});
    begin += size;
  };
  for (const Layer& layer : network.layers) {
    if (layer.op == LayerOp::kConv2d)
      add("layer." + std::to_string(tokens.size()), layer.weights.size() + layer.bias.size());
  }
  if (shape_coefficients > 0) add("shape", shape_coefficients);
  return tokens;
}

void read_weights(const Avatar& avatar, std::span<double> weights) {
  auto out = weights.begin();
  for (const Layer& layer : avatar.network.layers) {
    out = std::copy(layer.weights.begin(), layer.weights.end(), out);
    out = std::copy(layer.bias.begin(), layer.bias.end(), out);
  }
  out = std::copy(avatar.shape.begin(), avatar.shape.end(), out);
  FIG_CHECK(out == weights.end(), "one value for each of the avatar's");
}

RowMatrix read_weights(const Population& population) {
  const size_t shape = population.shape.size() / population.size();
  const size_t size = vector_size(weight_tokens(population.network, shape));
  RowMatrix all(static_cast<Eigen::Index>(population.size()), static_cast<Eigen::Index>(size));
  std::vector<float> storage(member_floats(population));
  for (size_t m = 0; m < population.size(); ++m)
    read_weights(open_member(population, m, storage), {&all(Eigen::Index(m), 0), size});
  return all;
}

Avatar with_weights(const Avatar& avatar, std::span<const double> weights,
                    std::span<float> storage) {
  FIG_CHECK(storage.size() == weights.size(), "a float for each value");
  std::transform(weights.begin(), weights.end(), storage.begin(),
                 [](double value) { return static_cast<float>(value); });
  Avatar changed = avatar;
  size_t at = 0;
  const auto take = [&](size_t count) {
    at += count;
    return std::span<const float>(storage.subspan(at - count, count));
  };
  for (Layer& layer : changed.network.layers) {
    layer.weights = take(layer.weights.size());
    layer.bias = take(layer.bias.size());
  }
  changed.shape = take(changed.shape.size());
  changed.fixed_point = {};
  FIG_CHECK(at == weights.size(), "one value for each of the avatar's");
  return changed;
}

Standardisation::Standardisation(const RowMatrix& training, std::vector<Token> tokens)
    : tokens_(std::move(tokens)),
      mean_(training.colwise().mean()),
      factor_(RowVector::Zero(training.cols())) {
  FIG_CHECK(training.rows() >= 2 && size_t(training.cols()) == vector_size(tokens_),
            "at least two members of these tokens");
  const auto members = static_cast<double>(training.rows());
  for (const Token& token : tokens_) {
    const auto begin = static_cast<Eigen::Index>(token.begin),
               end = static_cast<Eigen::Index>(token.begin + token.size);
    double squares = 0;
    size_t count = 0;
    for (Eigen::Index d = begin; d < end; ++d) {
      if (is_shared(training, d)) {
        mean_[d] = training(0, d);  // to the bit: a mean of equal values may differ from them
        continue;
      }
      squares += (training.col(d).array() - mean_[d]).square().sum();
      factor_[d] = 1;
      ++count;
    }
    const double scale =
        count == 0 ? 0 : std::sqrt(squares / (members * static_cast<double>(count)));
    if (count > 0) factor_.segment(begin, end - begin) /= scale;
    scale_.push_back(scale);
    varying_.push_back(count);
  }
}

size_t Standardisation::varying() const {
  size_t sum = 0;
  for (const size_t count : varying_) sum += count;
  return sum;
}

RowMatrix Standardisation::standardise(const RowMatrix& weights) const {
  return ((weights.rowwise() - mean_).array().rowwise() * factor_.array()).matrix();
}

RowVector Standardisation::restore(const RowVector& z) const {
  RowVector weights = mean_;
  for (size_t t = 0; t < tokens_.size(); ++t) {
    for (size_t i = tokens_[t].begin; i < tokens_[t].begin + tokens_[t].size; ++i) {
      const auto d = static_cast<Eigen::Index>(i);
      if (factor_[d] > 0) weights[d] += scale_[t] * z[d];
    }
  }
  return weights;
}

PrincipalBasis::PrincipalBasis(const RowMatrix& training, size_t begin, size_t size)
    : training_(&training), begin_(begin), size_(size) {
  const auto block =
      training.middleCols(static_cast<Eigen::Index>(begin), static_cast<Eigen::Index>(size));
  const Eigen::Index members = training.rows();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(members, members);
  gram.selfadjointView<Eigen::Lower>().rankUpdate(block);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      gram);  // ascending; reads the lower triangle
  const Eigen::VectorXd& values = solver.eigenvalues();
  Eigen::Index rank = 0;
  while (rank < members - 1 && values[members - 1 - rank] > kRounding * values[members - 1]) ++rank;
  variance_.resize(rank);
  mixture_.resize(members, rank);
  for (Eigen::Index k = 0; k < rank; ++k) {
    const double squares = values[members - 1 - k];
    variance_[k] = squares / static_cast<double>(members);
    mixture_.col(k) = solver.eigenvectors().col(members - 1 - k) / std::sqrt(squares);
  }
}

RowMatrix PrincipalBasis::directions(size_t rank) const {
  const auto block =
      training_->middleCols(static_cast<Eigen::Index>(begin_), static_cast<Eigen::Index>(size_));
  return mixture_.leftCols(static_cast<Eigen::Index>(std::min(rank, this->rank()))).transpose() *
         block;
}

Eigen::VectorXd PrincipalBasis::coordinates(const RowVector& z) const {
  const auto begin = static_cast<Eigen::Index>(begin_), size = static_cast<Eigen::Index>(size_);
  const Eigen::VectorXd against_members =
      training_->middleCols(begin, size) * z.segment(begin, size).transpose();
  return mixture_.transpose() * against_members;
}

RowVector PrincipalBasis::combine(const Eigen::VectorXd& coordinates, size_t rank) const {
  const auto block =
      training_->middleCols(static_cast<Eigen::Index>(begin_), static_cast<Eigen::Index>(size_));
  const auto used = static_cast<Eigen::Index>(std::min(rank, this->rank()));
  const Eigen::VectorXd of_members = mixture_.leftCols(used) * coordinates.head(used);
  return of_members.transpose() * block;
}

size_t directions_for(const Eigen::VectorXd& variance, double share) {
  const double wanted =
      share * variance.sum() * (1 - 1e-12);  // a share of exactly all must not fail by a rounding
  double sum = 0;
  for (Eigen::Index k = 0; k < variance.size(); ++k) {
    sum += variance[k];
    if (sum >= wanted) return static_cast<size_t>(k) + 1;
  }
  return static_cast<size_t>(variance.size());
}

double participation_ratio(const Eigen::VectorXd& variance) {
  const double squares = variance.squaredNorm(), sum = variance.sum();
  return squares > 0 ? sum * sum / squares : 0;
}

RowMatrix rms_distances(const RowMatrix& a, const RowMatrix& b, size_t varying) {
  // |x - y|^2 = |x|^2 + |y|^2 - 2 x.y, which cancels: distances below 1e-7 of the vectors' length
  // are rounding.
  RowMatrix squares = -2 * (a * b.transpose());
  squares.colwise() += a.rowwise().squaredNorm();
  squares.rowwise() += b.rowwise().squaredNorm().transpose();
  return (squares.array().max(0) / static_cast<double>(std::max<size_t>(varying, 1)))
      .sqrt()
      .matrix();
}

}  // namespace figurine::measure
